"""Lock bytes of a file, so that other processes and threads are kept out. A lock ends with its process."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import struct
import sys
from pathlib import Path

# The command of `fcntl` that sets a lock. Locks of an open file (OFD) exclude other threads of this process, too, as
# each thread opens the file itself. On systems without OFD locks, POSIX locks are used, which belong to the process.
# Both kinds work over NFS, and on bytes beyond the end of the file.
_SET_LOCK = getattr(fcntl, "F_OFD_SETLK", fcntl.F_SETLK)
# The command of `fcntl` that waits for a lock, and sets it.
_WAIT_FOR_LOCK = getattr(fcntl, "F_OFD_SETLKW", fcntl.F_SETLKW)


def lock_bytes(descriptor: int, first: int, length: int, *, wait: bool = False) -> bool | None:
    """Lock a range of bytes, and return whether it is locked, or None if the file system has no locks.

    length: 0 stands for all bytes from the first on. wait: whether to wait while another job holds one of the bytes;
    the range is otherwise not locked then. Raises OSError.
    """
    try:
        fcntl.fcntl(descriptor, _WAIT_FOR_LOCK if wait else _SET_LOCK, _flock(fcntl.F_WRLCK, first, length))
    except OSError as error:
        if error.errno in (errno.EACCES, errno.EAGAIN):
            return False
        if error.errno not in (errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP, errno.EINVAL):
            raise
        return None
    return True


def unlock_bytes(descriptor: int, first: int, length: int) -> None:
    """Unlock a range of bytes, as far as the file system has locks. length: as in `lock_bytes`."""
    with contextlib.suppress(OSError):
        fcntl.fcntl(descriptor, _SET_LOCK, _flock(fcntl.F_UNLCK, first, length))


def _flock(kind: int, first: int, length: int) -> bytes:
    """Return C's `struct flock` for a range of bytes, counted from the start of the file."""
    if sys.platform == "darwin":
        return struct.pack("qqihh", first, length, 0, kind, os.SEEK_SET)
    return struct.pack("hhqqi", kind, os.SEEK_SET, first, length, 0)


def is_path_of(file: Path, descriptor: int) -> bool:
    """Return whether a path is still the one of an open file, which may have been removed or replaced."""
    try:
        return os.path.samestat(file.stat(follow_symlinks=False), os.fstat(descriptor))
    except FileNotFoundError:
        return False
