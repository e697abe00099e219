"""One job at a time writes an output: a lock that is gone with the process that had it, however it ended."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import stat
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from renderer.errors import InputError, OutputLockedError
from renderer.film.atomic import remove_temporaries, translate_os_errors
from renderer.runs import consecutive_ranges

_MAX_OWNER_BYTES = 200
# Whoever comes or goes holds the file's first byte for a moment, so that nobody is refused for one who is going.
_GATE_BYTE, _FIRST_SLOT_BYTE = 0, 1


@contextlib.contextmanager
def lock_slots(folder: Path, places: Sequence[int], output: Path) -> Iterator[None]:
    """Hold these places, ascending, of a folder of what is not finished, which is made where it is missing.

    Jobs that have no place in common do not keep each other out. The last one to leave removes temporary files of those
    that were killed, and the folder, if nothing else is in it. On a file system without locks nobody is kept out.
    Raises OutputLockedError when another process holds one of the places; InputError when the folder cannot be one, and
    RenderError when it cannot be made. output: for messages.
    """
    with translate_os_errors(output):
        descriptor = _enter(folder)
    try:
        with translate_os_errors(output):
            _acquire_slots(descriptor, places, output)
        yield
    finally:
        _release_slots(folder, descriptor)


@contextlib.contextmanager
def exclusive_lock(file: Path, pause: Callable[[str | None], None]) -> Iterator[None]:
    """Wait until no other process is in such a block with this lock file, which is made and removed again.

    pause: called before each further look, with what is known of the process that is in it: `process 12 on ada`. What
    it raises ends the waiting. On a file system without locks nobody waits.
    Raises InputError and RenderError where the file cannot be made.
    """
    with translate_os_errors(file):
        descriptor = _wait_for(file, pause)
    try:
        with translate_os_errors(file):
            _write_owner(descriptor)
        yield
    finally:
        with contextlib.suppress(OSError):
            if _is_there(file, descriptor):
                file.unlink()
        os.close(descriptor)


def require_folder_if_exists(folder: Path) -> None:
    """Raise InputError if something that is no folder has the name of a folder of what is not finished."""
    with contextlib.suppress(FileNotFoundError):
        mode = folder.lstat().st_mode
        if not stat.S_ISDIR(mode):
            raise InputError(
                "something else has the name of the folder for frames of a film that is not whole",
                where=str(folder),
                got="a link" if stat.S_ISLNK(mode) else "a file",
                hint="give it another name, or the film another --output",
            )


def _enter(folder: Path) -> int:
    """The lock file, at whose gate nobody else is."""
    while True:
        _make(folder)
        with contextlib.suppress(FileNotFoundError):  # its last holder has removed the folder meanwhile
            return _wait_for(_lock_file(folder))


def _wait_for(file: Path, pause: Callable[[str | None], None] | None = None) -> int:
    """A lock file that is there, with its first byte held. pause: as in `alone`."""
    while True:
        descriptor = _open(file)
        try:
            while _lock(descriptor, _GATE_BYTE, 1, wait=pause is None) is False:
                assert pause is not None
                pause(_holder(descriptor))
            if _is_there(file, descriptor):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)  # its last holder has removed it meanwhile


def _open(file: Path) -> int:
    """A lock file, which is made where it is missing; FileNotFoundError where its folder is. Raises InputError, too."""
    flags = os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW
    while True:
        with contextlib.suppress(FileNotFoundError):
            _require_plain(file)
            return os.open(file, flags)  # not O_CREAT: in a folder such as /tmp no file of another user opens with it
        with contextlib.suppress(FileExistsError):
            descriptor = os.open(file, flags | os.O_CREAT | os.O_EXCL, 0o600)
            _share(descriptor, file.parent)
            return descriptor


def _require_plain(file: Path) -> None:
    mode = file.lstat().st_mode
    if not stat.S_ISREG(mode):
        kinds = ((stat.S_ISLNK, "a link"), (stat.S_ISDIR, "a folder"))
        got = next((kind for is_of, kind in kinds if is_of(mode)), "a device or a pipe")
        raise InputError("something else has the name of a lock file", where=str(file), got=got, hint="remove it")


def _share(descriptor: int, folder: Path) -> None:
    """Let everybody lock a file who may write in its folder, also where it stays because its maker was killed."""
    with contextlib.suppress(OSError):  # not every file system has owners
        place = folder.stat()
        for owner in (-1, place.st_uid):  # the latter where the superuser works in the folder of somebody else
            with contextlib.suppress(OSError):  # the folder may be of a group to which its writer does not belong
                os.fchown(descriptor, owner, place.st_gid)
        is_same_group = os.fstat(descriptor).st_gid == place.st_gid
        group = 0o060 if place.st_mode & stat.S_IWGRP and is_same_group else 0
        others = 0o006 if place.st_mode & stat.S_IWOTH else 0
        os.fchmod(descriptor, 0o600 | group | others)


def _make(folder: Path) -> None:
    folder.parent.mkdir(parents=True, exist_ok=True)
    with contextlib.suppress(FileExistsError):
        folder.mkdir()
    require_folder_if_exists(folder)


def _acquire_slots(descriptor: int, places: Sequence[int], output: Path) -> None:
    """Lock these places and leave the gate."""
    for start, stop in consecutive_ranges(places):
        if _lock(descriptor, _FIRST_SLOT_BYTE + start, stop - start) is False:
            raise OutputLockedError(
                "another job is writing this output",
                where=str(output),
                got=_holder(descriptor),
                hint="wait until it is done, or give this one another output",
            )
    _write_owner(descriptor)
    with contextlib.suppress(OSError):  # there are no locks
        fcntl.lockf(descriptor, fcntl.LOCK_UN, 1, _GATE_BYTE)


def _write_owner(descriptor: int) -> None:
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, f"process {os.getpid()} on {os.uname().nodename}".encode(), 0)


def _holder(descriptor: int) -> str | None:
    """Who has signed last, if that can be shown."""
    note = os.pread(descriptor, _MAX_OWNER_BYTES, 0).decode(errors="replace")
    return note if note and note.isprintable() else None


def _release_slots(folder: Path, descriptor: int) -> None:
    """Give the places back; the last one tidies up."""
    try:
        _lock(descriptor, _GATE_BYTE, 1, wait=True)
        is_last = _lock(descriptor, _GATE_BYTE, 0)
        if is_last is False or (is_last and not _is_there(_lock_file(folder), descriptor)):
            return
        if is_last:  # and not one of many, for all that can be known
            remove_temporaries(folder)
        _lock_file(folder).unlink(missing_ok=True)
        folder.rmdir()
    except OSError:  # something is in it, or it has vanished
        pass
    finally:
        os.close(descriptor)


def _lock(descriptor: int, first: int, length: int, *, wait: bool = False) -> bool | None:
    """Whether this run of bytes, up to the last for length 0, is held now; not where another process holds one of them.

    None where the file system has no locks.
    """
    # POSIX locks: they work over NFS, are not inherited by children, and bytes need not be there.
    try:
        fcntl.lockf(descriptor, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB, length, first)
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN):
            return False
        if error.errno not in (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL):
            raise
        return None
    return True


def _lock_file(folder: Path) -> Path:
    return folder / "lock"


def _is_there(file: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(file.stat(follow_symlinks=False), os.fstat(descriptor))
    except FileNotFoundError:
        return False
