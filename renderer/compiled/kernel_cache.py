"""A cache of compiled loops on disk, in place of numba's own.

numba's cache notices an edit of a function's own file, but none of the files of functions that it calls; processes that
compile a loop for different types at once mix up their files; and a damaged file ends the program. Here the folder is
named by a digest of all sources. Each entry is a file, named by its function and signature. It begins with a digest of
the rest: LLVM, which ends the process where machine code is damaged, sees only what was written. Entries hold pickles,
so whoever can write to the folder is trusted as the authors of the code are.
"""

from __future__ import annotations

import contextlib
import hashlib
import inspect
import os
import pickle
import shutil
import sys
import uuid
from collections.abc import Callable
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from renderer.compiled.numba_inside import CompileResult, dumps, import_functions, numba

_SOURCES = Path(__file__).resolve().parents[1]
_DIGEST_BYTES = 16
# Caches of sources that nobody has run for 30 days are removed.
_PREFIX, _SUFFIX, _MAX_UNUSED_S = "kernels-", ".nbc", 30 * 86400.0
# Marks a folder as a cache, which backups may leave out (bford.info/cachedir), and as one of ours.
_TAG_FILE, _TAG = "CACHEDIR.TAG", "Signature: 8a477f597d28d172789f06886806bc55\n# compiled loops of hsplat\n"


def _source_states() -> dict[Path, tuple[int, int]]:
    """Return the time of change and the size of all sources."""
    statuses = {path: path.stat() for path in sorted(_SOURCES.rglob("*.py")) if path.is_file()}
    return {path: (status.st_mtime_ns, status.st_size) for path, status in statuses.items()}


# As they are imported. The folder is found later, and must not be that of sources that have been edited meanwhile.
_IMPORTED = _source_states()


class _Store:
    """A folder of compiled loops, which is found and made when it is first needed; it may not exist.

    problem: why loops are not kept for later runs, if they are not.
    """

    problem: str | None = None

    @cached_property
    def folder(self) -> Path | None:
        """A writable folder for these sources: where the user wants it, beside them, or in the user's home."""
        digest = hashlib.blake2b(f"{numba.__version__} {sys.implementation.cache_tag}".encode(), digest_size=8)
        for source in _IMPORTED:
            digest.update(source.read_bytes())
        if _source_states() != _IMPORTED:
            self.problem = "the sources of hsplat have changed since it was started"
            return None
        for base in (*_chosen_bases(), _SOURCES / "__pycache__", Path("~/.cache/hsplat")):
            try:
                folder = base.expanduser() / f"{_PREFIX}{digest.hexdigest()}"
                is_new = not folder.is_dir()
                folder.mkdir(parents=True, exist_ok=True)
                if is_new:
                    (folder / _TAG_FILE).write_text(_TAG, encoding="ascii")
                os.utime(folder)  # marks it as in use
            except (OSError, RuntimeError) as error:  # RuntimeError: no home folder
                self.problem = str(error)
                continue
            if os.access(folder, os.W_OK):
                self.problem = None
                return folder
            self.problem = f"{folder} cannot be written"
        return None


_store = _Store()


def _chosen_bases() -> list[Path]:
    return [Path(numba.config.CACHE_DIR)] if numba.config.CACHE_DIR else []


def has_cached_kernels() -> bool:
    """Return whether compiled loops of these sources are in the cache. If not, the first calls compile them."""
    return _store.folder is not None and any(_store.folder.glob(f"*{_SUFFIX}"))


def cache_problem() -> str | None:
    """Return why this process cannot keep the loops that it compiles, as far as it has found out; None if it can."""
    return _store.problem


def remove_unused_caches() -> None:
    """Remove the caches of other sources that nobody has used for 30 days, but none from a folder set by the user."""
    folder = _store.folder
    if folder is None or folder.parent in [base.expanduser() for base in _chosen_bases()]:
        return
    for other in folder.parent.glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError, ValueError):
            is_ours = (other / _TAG_FILE).read_text(encoding="ascii") == _TAG
            if is_ours and folder.stat().st_mtime - other.stat().st_mtime > _MAX_UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)


class KernelCache:
    """A cache of one function, in the place and with the methods of numba's own cache."""

    def __init__(self, function: Callable[..., object]) -> None:
        assert function.__closure__ is None, "the values of a closure are in no digest"
        self._function = function

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Return the compiled function for a signature; None if there is none, or it is damaged."""
        import_functions()
        target_context.refresh()
        if _store.folder is None:
            return None
        key = self._key(signature, target_context.codegen())
        try:
            entry = (_store.folder / self._file_name(key)).read_bytes()
        except OSError:
            return None
        digest, data = entry[:_DIGEST_BYTES], entry[_DIGEST_BYTES:]
        if digest != _digest(data, key):
            return None
        return CompileResult._rebuild(target_context, *pickle.loads(data))  # noqa: S301  its writers are trusted

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Write the compiled function for a signature, or remember why it cannot be written."""
        assert not compiled.library.has_dynamic_globals, "addresses are of this process alone"
        if _store.folder is None:
            return
        key, data = self._key(signature, compiled.library.codegen), dumps(compiled._reduce())
        try:
            _write_whole(_store.folder / self._file_name(key), _digest(data, key) + data)
        except OSError as error:
            _store.problem = f"{_store.folder}: {error.strerror}"

    def _key(self, signature: Any, code_generator: Any) -> bytes:
        """Return what says which function is compiled, for which types and processor."""
        source = _file_digest(inspect.getfile(self._function))
        parts = (source, self._function.__qualname__, signature, code_generator.magic_tuple())
        return _digest(repr(parts).encode())

    def _file_name(self, key: bytes) -> str:
        return f"{self._function.__module__}.{self._function.__qualname__}-{key.hex()}{_SUFFIX}"


def _digest(data: bytes, key: bytes = b"") -> bytes:
    return hashlib.blake2b(data, digest_size=_DIGEST_BYTES, key=key).digest()


@cache
def _file_digest(file: str) -> bytes:
    return _digest(Path(file).read_bytes())


def _write_whole(path: Path, data: bytes) -> None:
    """Write a file that other processes see whole or not at all."""
    unfinished = path.with_suffix(f".{uuid.uuid4().hex}")
    try:
        unfinished.write_bytes(data)
        unfinished.replace(path)
    except OSError:
        unfinished.unlink(missing_ok=True)
        raise
