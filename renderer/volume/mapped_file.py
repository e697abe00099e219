"""Map the voxels of large files into memory, where they are read page by page when they are used.

The system drops such pages when memory is short, so a volume may be larger than memory. In return, the file must not
change: reading a page beyond the end of a shortened file kills the process (SIGBUS), unless zeros are mapped there
(`truncation_guard.py`). So callers call `MappedFile.require_unchanged` before they read voxels, and again before they
use these.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.volume.arrays import Array

# The hint of errors about changed files.
_HINT = "large volumes are read from their files while they are drawn: start again, and do not change this file"


@dataclass(frozen=True)
class MappedFile:
    """A file that voxels are mapped from, and its state when it was opened.

    path: its absolute path. state: its device and inode, which identify it under any name; its size; the time of its
        last change. may_go: whether its name may be removed, or given to another file: mapped voxels stay.
    """

    path: Path
    state: tuple[int, int, int, int]
    may_go: bool = False

    def require_unchanged(self) -> None:
        """Raise InputError if the file is missing, was replaced, has another length, or was written to.

        A file that may go may be missing or replaced.
        """
        got = expected = None
        try:
            state = _file_state(self.path)
        except OSError as error:
            if self.may_go:
                return
            change, got = "was removed", error.strerror
        else:
            if state == self.state or (self.may_go and state[:2] != self.state[:2]):
                return
            size, old_size = state[2], self.state[2]
            change = "was written to"
            if state[:2] != self.state[:2]:
                change = "was replaced by another"
            elif size != old_size:
                change = "became shorter" if size < old_size else "grew"
                got, expected = f"{size} bytes", f"{old_size} bytes, as when it was opened"
        what = f"the volume's file {change} while it was in use"
        raise InputError(what, where=str(self.path), got=got, expected=expected, hint=_HINT)


def _file_state(path: Path) -> tuple[int, int, int, int]:
    status = path.stat()
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


def time_of_change(file: MappedFile) -> int:
    """Return the time of the last change of a file's content or state, in nanoseconds; 0 if the file is gone.

    No program can set this time.
    """
    try:
        return file.path.stat().st_ctime_ns
    except OSError:
        return 0


def place_in_file(values: Array) -> int:
    """Return the byte of a file at which an array begins that is mapped from it, as `backing_file` finds."""
    root = _mapped_root(values)
    return int(root.offset) + _address(values) - _address(root)


def _address(values: Array) -> int:
    return int(values.__array_interface__["data"][0])


def backing_file(values: Array) -> MappedFile | None:
    """Return the file that an array [z, y, x], or its base array, is mapped from; None for an array in memory.

    Raises OSError if the file is missing.
    """
    root = _mapped_root(values)
    if root is None or root.filename is None:
        return None
    path = Path(root.filename).absolute()
    return MappedFile(path, _file_state(path))


def _mapped_root(values: Array) -> Any:
    """Return the memmap that an array is a view of, perhaps the array itself; None for an array in memory."""
    base: Any = values
    root: Any = None
    while isinstance(base, np.ndarray):
        if isinstance(base, np.memmap):
            root = base
        base = base.base
    return root
