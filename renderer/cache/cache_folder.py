"""Keep named arrays in a folder, as entries that are whole or missing.

An entry is a folder, `<kind>-<digest>`, with a `.npy` file for each array. It is made under a temporary name, and
renamed at the end: a kill leaves no half of it, and of two processes that make the same entry one keeps it. A lock lets
one process alone make an entry, for which others wait; it ends with its process. Entries that take too much room
together are removed, the least recently used first. A process that has mapped one keeps its bytes.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
import tempfile
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError
from renderer.system import is_path_of, lock_bytes, sources_digest, unlock_bytes

Array = npt.NDArray[Any]

# The share of a disk's room, free or taken by entries, that entries may take together.
_SHARE_OF_DISK = 1 / 4
# The beginning of the names of entries that are being made.
_TEMPORARY = "making-"
# The end of the names of lock files of entries that are being made.
_LOCK = ".lock"
# The age, in seconds, at which an entry that is being made counts as left behind by a process that was killed: a week,
# in which a later process may go on with it.
_LEFT_BEHIND = 7 * 24 * 3600
# The seconds that a process waits for another one before the user is told. Most entries are made in less time.
_PATIENCE = 1.0
# The sentence for the user while another process makes an entry.
_WAITING = "another process reads or builds the same for the cache folder; this one waits for it"


def _ignore(_text: str) -> None:
    """Tell nobody."""


@dataclass(frozen=True)
class CacheFolder:
    """A folder of entries. Several processes and threads may use it at a time.

    path: the folder, which exists. tell: a function that is called with a sentence for the user.
    """

    path: Path
    tell: Callable[[str], object] = _ignore

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
    def adding(self, kind: str, facts: object, *, resumes: bool = False) -> Iterator[Path]:
        """Yield a folder for the `.npy` files of an entry, which is kept unless the block raises.

        A full or unwritable disk is no error: the entry is then missing. resumes: whether the folder has the files that
        a process left which was ended while it made the same entry, and leaves its own if the block raises; for a
        block of `alone`. It is otherwise empty. Files of other types are removed when the entry is whole.
        """
        making = self._making_folder(kind, facts, resumes=resumes)
        is_left = resumes
        try:
            yield making
            for other in making.iterdir():
                if other.suffix != ".npy":
                    other.unlink()
            os.utime(making)
            now = making.stat().st_mtime
            with contextlib.suppress(OSError):  # another process may have made the same entry
                making.rename(self._entry(kind, facts))
            is_left = False
            self._limit(now)
        except OSError:
            is_left = False
        finally:
            if not is_left:
                shutil.rmtree(making, ignore_errors=True)

    @contextlib.contextmanager
    def alone(self, kind: str, facts: object) -> Iterator[bool]:
        """Keep other processes and threads out while the block makes an entry; first wait for one that makes it.

        Yields whether others are kept out: they are not where the file system has no locks. kind, facts: as in `find`,
        which may find the entry in the block.
        """
        file = self.path / f"{_TEMPORARY}{self._entry(kind, facts).name}{_LOCK}"
        descriptor = self._locked(file)
        try:
            yield descriptor is not None
        finally:
            if descriptor is not None:
                file.unlink(missing_ok=True)
                unlock_bytes(descriptor, 0, 1)  # closing is not enough: a child that starts may share the open file
                os.close(descriptor)

    def _locked(self, file: Path) -> int | None:
        """Return the descriptor of a lock file, which is made and locked; None if that is not possible."""
        while True:
            with contextlib.ExitStack() as stack:
                try:
                    descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o666)
                    stack.callback(os.close, descriptor)
                    if not self._wait_for(descriptor):
                        return None
                except OSError:
                    return None
                if is_path_of(file, descriptor):  # the process that had the lock removes the file
                    stack.pop_all()
                    return descriptor

    def _wait_for(self, descriptor: int) -> bool:
        """Lock a lock file. Return whether it is locked, and not on a file system without locks. Raises OSError."""
        is_locked = lock_bytes(descriptor, 0, 1)
        if is_locked is not False:
            return bool(is_locked)
        timer = threading.Timer(_PATIENCE, self.tell, (_WAITING,))
        timer.start()
        try:
            return bool(lock_bytes(descriptor, 0, 1, wait=True))
        finally:
            timer.cancel()

    def _making_folder(self, kind: str, facts: object, *, resumes: bool) -> Path:
        """Return the folder in which an entry is made. Arguments: as in `adding`. Raises OSError."""
        if not resumes:
            return Path(tempfile.mkdtemp(prefix=_TEMPORARY, dir=self.path))
        making = self.path / f"{_TEMPORARY}{self._entry(kind, facts).name}"
        making.mkdir(exist_ok=True)
        os.utime(making)  # it is not left behind any longer
        return making

    def now(self) -> float:
        """Return the time in seconds, by the clock of the folder's file system. Raises OSError on a full disk."""
        with tempfile.TemporaryDirectory(prefix=_TEMPORARY, dir=self.path) as made:
            return Path(made).stat().st_mtime

    def _entry(self, kind: str, facts: object) -> Path:
        text = repr((sources_digest(), facts))
        return self.path / f"{kind}-{hashlib.blake2b(text.encode(), digest_size=16).hexdigest()}"

    def _limit(self, now: float) -> None:
        """Remove the least recently used entries beyond the share of the disk, and what killed processes left."""
        for lock in self.path.glob(f"{_TEMPORARY}*{_LOCK}"):
            with contextlib.suppress(OSError):  # the process that has it has removed it
                if now - lock.stat().st_mtime > _LEFT_BEHIND:
                    lock.unlink()
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


def kept_bytes(path: Path) -> int:
    """Return the bytes that the entries of a folder take on the disk; 0 for a folder that is not there."""
    total = 0
    for file in path.glob("*-*/*.npy"):
        with contextlib.suppress(OSError):  # another process has removed it
            total += _taken_by(file)
    return total


# The folders that blocks of this process use, the innermost one last.
_IN_USE: list[CacheFolder | None] = [None]


def cache_folder() -> CacheFolder | None:
    """Return the folder of this process, None without one."""
    return _IN_USE[-1]


@contextlib.contextmanager
def caching_in(path: Path | None, tell: Callable[[str], object] = _ignore) -> Iterator[None]:
    """Keep entries of this process in a folder while the block runs. path: None for no folder. tell: as in CacheFolder.

    Raises InputError if the path is not a folder and cannot become one, or cannot be written.
    """
    _IN_USE.append(None if path is None else _opened(path, tell))
    try:
        yield
    finally:
        _IN_USE.pop()


def _opened(path: Path, tell: Callable[[str], object]) -> CacheFolder:
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
    return CacheFolder(path.resolve(), tell)
