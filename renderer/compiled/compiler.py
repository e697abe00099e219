"""Compile loops with numba: cached on disk, without the GIL, with arithmetic as written.

numba checks only a function's own file to see whether its cache is stale, not the files of the functions it calls. The
cache is therefore in a folder named by a digest of all sources: an edit anywhere compiles everything again, once.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib
import os
import shutil
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from llvmlite import ir
from numba.core import caching, cgutils, types
from numba.extending import intrinsic

from renderer.compiled.lanes import Lanes, lanes_among, multiply_add

Function = TypeVar("Function", bound=Callable[..., object])

_config: Any = numba.config  # its attributes are defined at run time
_cgutils: Any = cgutils  # has no types
_IndexDataCacheFile: Any = caching.IndexDataCacheFile

# Where scipy is installed, numba imports scipy.linalg, which takes as long as numba itself, to see whether np.convolve
# can use its BLAS. Here the answer is no, without the import: no loop calls np.convolve.
_SCIPY_BLAS = "scipy.linalg.cython_blas"
if _SCIPY_BLAS not in sys.modules:
    sys.modules[_SCIPY_BLAS] = None  # type: ignore[assignment]
    importlib.import_module("numba.np.arraymath")
    del sys.modules[_SCIPY_BLAS]

# The cache folder of sources that nobody has run for 30 days is removed when another one is created.
_PREFIX, _MAX_UNUSED_S = "kernels-", 30 * 86400.0
# Marks a folder as a cache, which backups may leave out (bford.info/cachedir), and as one of ours.
_TAG_FILE, _TAG = "CACHEDIR.TAG", "Signature: 8a477f597d28d172789f06886806bc55\n# compiled loops of hsplat\n"
_setting = threading.Lock()


def _cache_folder() -> Path | None:
    """Return a writable folder for these sources, where the user wants it, beside them, or in the user's home; or None.

    Nothing is removed from a folder that the user has set.
    """
    here = Path(__file__).resolve().parents[1]
    digest = hashlib.blake2b(numba.__version__.encode(), digest_size=8)
    for source in sorted(here.rglob("*.py")):
        digest.update(source.read_bytes())
    chosen = [Path(_config.CACHE_DIR)] if _config.CACHE_DIR else []
    for base in (*chosen, here / "__pycache__", Path("~/.cache/hsplat")):
        try:
            folder = base.expanduser() / f"{_PREFIX}{digest.hexdigest()}"
            is_new = not folder.is_dir()
            folder.mkdir(parents=True, exist_ok=True)
            if is_new:
                (folder / _TAG_FILE).write_text(_TAG, encoding="ascii")
            os.utime(folder)  # marks it as in use
        except (OSError, RuntimeError):  # RuntimeError: no home folder
            continue
        if os.access(folder, os.W_OK):
            if is_new and base not in chosen:
                _remove_unused(folder)
            return folder
    return None


def _remove_unused(folder: Path) -> None:
    """Remove our caches of other sources beside a folder that have not been used for long."""
    now = folder.stat().st_mtime
    for other in folder.parent.glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError, ValueError):
            is_ours = (other / _TAG_FILE).read_text(encoding="ascii") == _TAG
            if is_ours and now - other.stat().st_mtime > _MAX_UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)


_FOLDER = _cache_folder()


def has_cached_kernels() -> bool:
    """Return whether compiled loops of these sources are in the cache. If not, the first calls compile them."""
    return _FOLDER is not None and any(_FOLDER.rglob("*.nbi"))


class _KernelFiles(_IndexDataCacheFile):  # type: ignore[misc]  # numba has no types
    """A cache that names the file of a compiled loop after its signature.

    numba gives files the next free number. Two processes that compile the same loop for different types at the same
    time choose the same number, and the machine code for one type is then loaded for the other.
    """

    def save(self, key: object, data: object) -> None:
        """Write an entry. Another process may still overwrite the index without it; the loop is then compiled again."""
        digest = hashlib.blake2b(repr(key).encode(), digest_size=8).digest()
        name = self._data_name(int.from_bytes(digest, "big"))
        self._save_data(name, data)
        self._save_index({**self._load_index(), key: name})


def jit(function: Function) -> Function:
    """Compile a function with numba. mypy still sees its type, which numba's own decorator hides.

    Without a writable folder for the cache, as in a container with a read-only file system, every process compiles for
    itself.
    """
    if _FOLDER is None:
        return cast(Function, numba.njit(nogil=True, error_model="numpy")(function))
    with _numba_cache_folder(_FOLDER):
        compiled: Any = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    cache = compiled._cache
    stamp = cache._impl.locator.get_source_stamp()
    cache._cache_file = _KernelFiles(cache.cache_path, cache._impl.filename_base, stamp)
    return cast(Function, compiled)


def inline(function: Function) -> Function:
    """Compile a function into those that call it. Their arguments, lanes or arrays, are then passed without a cost."""
    return cast(Function, numba.njit(nogil=True, error_model="numpy", forceinline=True)(function))


@contextlib.contextmanager
def _numba_cache_folder(folder: Path) -> Iterator[None]:
    """Set the folder in which numba caches functions that are declared in the block; other code keeps its own."""
    with _setting:
        before = _config.CACHE_DIR
        _config.CACHE_DIR = str(folder)
        try:
            yield
        finally:
            _config.CACHE_DIR = before


@intrinsic
def _fma(_: Any, x: Any, y: Any, z: Any) -> Any:
    """Call LLVM's instruction; a processor without it computes the same result step by step."""
    kind = lanes_among((x, y, z)) or x
    if not (isinstance(kind, Lanes) or (x == y == z and isinstance(x, types.Float))):
        return None
    return kind(kind, kind, kind), lambda _context, builder, _signature, arguments: multiply_add(
        builder, kind, arguments
    )


# x * y + z, rounded once; in compiled loops only.
fma = cast(Callable[[np.float32, np.float32, np.float32], np.float32], _fma)


@intrinsic
def _prefetch(_: Any, address: Any) -> Any:
    """Give LLVM's hint; 3 and 1 ask for data in the first-level cache."""

    def generate(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        pointer, number = ir.PointerType(ir.IntType(8)), ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [pointer, number, number, number])
        hint = _cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
        builder.call(hint, [builder.inttoptr(arguments[0], pointer), number(0), number(3), number(1)])
        return context.get_dummy_value()

    return types.void(types.int64), generate


# Hints that the memory at an address, if any, is read soon; in compiled loops only.
prefetch = cast(Callable[[int], None], _prefetch)
