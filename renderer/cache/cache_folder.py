"""Keep named arrays in a folder, as entries that are whole or missing.

An entry is a folder, `<kind>-<digest>`, with a `.npy` file for each array. It is made under a temporary name, and
renamed at the end: a kill leaves no half of it, and of two processes that make the same entry one keeps it. Entries
that take too much room together are removed, the least recently used first. A process that has mapped one keeps its
bytes.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError
from renderer.system import sources_digest

Array = npt.NDArray[Any]

# The share of a disk's room, free or taken by entries, that entries may take together.
_SHARE_OF_DISK = 1 / 4
# The beginning of the names of entries that are being made.
_TEMPORARY = "making-"
# The age, in seconds, at which an entry that is being made counts as left behind by a process that was killed.
_LEFT_BEHIND = 24 * 3600


@dataclass(frozen=True)
class CacheFolder:
    """A folder of entries. Several processes and threads may use it at a time.

    path: the folder, which exists.
    """

    path: Path

    def find(self, kind: str, facts: object) -> Mapping[str, Array] | None:
        """Return the arrays of an entry, read-only and mapped from their files; None if there is no such entry.

        kind: a word for what entries are. facts: what the entry was made from; its `repr` tells entries apart.
        An entry that cannot be read is removed.
        """
        entry = self._entry(kind, facts)
        if not entry.is_dir():
            return None
        try:
            files = sorted(entry.glob("*.npy"))
            found = {file.stem: np.load(file, mmap_mode="r", allow_pickle=False) for file in files}
        except (OSError, EOFError, ValueError):
            shutil.rmtree(entry, ignore_errors=True)
            return None
        with contextlib.suppress(OSError):  # another user's entry may be one that this process can only read
            os.utime(entry)
        return found

    def remove(self, kind: str, facts: object) -> None:
        """Remove an entry, if there is one. kind, facts: as in `find`."""
        shutil.rmtree(self._entry(kind, facts), ignore_errors=True)

    def add(self, kind: str, facts: object, arrays: Mapping[str, Array]) -> None:
        """Keep arrays as an entry. kind, facts: as in `find`. The names of arrays are names of files."""
        with self.adding(kind, facts) as entry:
            for name, array in arrays.items():
                np.save(entry / f"{name}.npy", array, allow_pickle=False)

    @contextlib.contextmanager
    def adding(self, kind: str, facts: object) -> Iterator[Path]:
        """Yield an empty folder for the `.npy` files of an entry, which is kept unless the block raises.

        A full or unwritable disk is no error: the entry is then missing.
        """
        making = Path(tempfile.mkdtemp(prefix=_TEMPORARY, dir=self.path))
        try:
            yield making
            now = making.stat().st_mtime
            with contextlib.suppress(OSError):  # another process may have made the same entry
                making.rename(self._entry(kind, facts))
            self._limit(now)
        except OSError:
            pass
        finally:
            shutil.rmtree(making, ignore_errors=True)

    def now(self) -> float:
        """Return the time in seconds, by the clock of the folder's file system. Raises OSError on a full disk."""
        with tempfile.TemporaryDirectory(prefix=_TEMPORARY, dir=self.path) as made:
            return Path(made).stat().st_mtime

    def _entry(self, kind: str, facts: object) -> Path:
        text = repr((sources_digest(), facts))
        return self.path / f"{kind}-{hashlib.blake2b(text.encode(), digest_size=16).hexdigest()}"

    def _limit(self, now: float) -> None:
        """Remove the least recently used entries beyond the share of the disk, and what killed processes left."""
        entries = sorted((each for each in self.path.iterdir() if each.is_dir()), key=lambda each: each.stat().st_mtime)
        sizes = {entry: sum(map(_taken_by, entry.iterdir())) for entry in entries}
        most = _SHARE_OF_DISK * (shutil.disk_usage(self.path).free + sum(sizes.values()))
        for entry in entries:
            is_made = not entry.name.startswith(_TEMPORARY)
            is_old = now - entry.stat().st_mtime > _LEFT_BEHIND
            if (is_made and sum(sizes.values()) > most) or (not is_made and is_old):
                shutil.rmtree(entry, ignore_errors=True)
                del sizes[entry]


def _taken_by(file: Path) -> int:
    """Return the bytes that a file takes on the disk: a sparse one takes fewer than it has."""
    state = file.stat()
    return min(state.st_size, 512 * state.st_blocks)


# The folders that blocks of this process use, the innermost one last.
_IN_USE: list[CacheFolder | None] = [None]


def cache_folder() -> CacheFolder | None:
    """Return the folder of this process, None without one."""
    return _IN_USE[-1]


@contextlib.contextmanager
def caching_in(path: Path | None) -> Iterator[None]:
    """Keep entries of this process in a folder while the block runs. path: None for no folder.

    Raises InputError if the path is not a folder and cannot become one, or cannot be written.
    """
    _IN_USE.append(None if path is None else _opened(path))
    try:
        yield
    finally:
        _IN_USE.pop()


def _opened(path: Path) -> CacheFolder:
    try:
        path.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=path).close()
    except OSError as error:
        raise InputError(
            "this folder cannot keep anything",
            where="--cache",
            got=f"{path} ({error.strerror})",
            expected="a folder that can be written, or a path where one can be made",
        ) from error
    return CacheFolder(path.resolve())
