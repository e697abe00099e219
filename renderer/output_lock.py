"""One job at a time writes an output: a lock that is gone with the process that had it, however it ended."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from renderer.errors import InputError
from renderer.staging import explained

_LONGEST_NOTE = 200


@contextlib.contextmanager
def locked(file: Path, places: Sequence[int], output: Path) -> Iterator[None]:
    """Hold these places, ascending, of a lock file, which is made where it is missing and removed by the last holder.

    Jobs that have no place in common do not keep each other out. On a file system without locks nobody is kept out.
    Raises InputError when another process holds one of the places. output: for messages.
    """
    with explained(output):
        descriptor = _locked_file(file, places, output)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # of others that still hold places
            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            file.unlink(missing_ok=True)
        os.close(descriptor)


def _locked_file(file: Path, places: Sequence[int], output: Path) -> int:
    while True:
        descriptor = os.open(file, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            _lock(descriptor, places, output)
            if _is_there(file, descriptor):
                os.ftruncate(descriptor, 0)
                os.pwrite(descriptor, f"process {os.getpid()} on {os.uname().nodename}".encode(), 0)
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)  # its last holder has removed it meanwhile


def _lock(descriptor: int, places: Sequence[int], output: Path) -> None:
    # POSIX locks: they work over NFS, are not inherited by children, and places that nobody holds cost nothing.
    for first, length in _runs(places):
        try:
            fcntl.lockf(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB, length, first)
        except OSError as error:
            if error.errno not in (errno.EACCES, errno.EAGAIN):
                if error.errno in (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL):
                    return
                raise
            note = os.pread(descriptor, _LONGEST_NOTE, 0).decode(errors="replace")
            raise InputError(
                "another job is writing this output",
                where=str(output),
                got=note if note.isprintable() and note else None,
                hint="wait until it is done, or give this one another --output",
            ) from error


def _runs(places: Sequence[int]) -> Iterator[tuple[int, int]]:
    """First place and length of each run of places without a gap."""
    first = last = places[0]
    for place in places[1:]:
        if place != last + 1:
            yield first, last - first + 1
            first = place
        last = place
    yield first, last - first + 1


def _is_there(file: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(file.stat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False
