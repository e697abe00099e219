"""Read volume files of all formats in this process, without the child process that large libraries have."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.readers import Image, call_reader, check_memory
from renderer.volume import Array, tell_pass


class ThisProcess(Any):
    """The host of a reader of files, if the reader runs in this process: it stands in for a parent process."""

    def __init__(self) -> None:
        """Make a host that needs no connection to another process."""

    def allocate(self, shape: tuple[int, ...], dtype: npt.DTypeLike) -> Array:
        return np.zeros(shape, dtype)

    def fill(self, part: Array, voxels: Array) -> None:
        """Write voxels to a part of an array."""
        part[...] = voxels

    def expect_bytes(self, num_bytes: int) -> None:
        """Accept any number of bytes, as this process has no limit."""

    def require_room(self, num_bytes: int) -> None:
        """Raise InputError if the voxels do not fit into memory."""
        check_memory(num_bytes)

    def has_piece(self, _name: str, _voxels: Array) -> bool:
        """Return False, as nothing is remembered."""
        return False

    def add_piece(self, name: str, voxels: Array) -> None:
        """Do nothing, as nothing is remembered."""

    def tell_progress(self, num_read: int, num_bytes: int, what: str) -> None:
        """Tell this process how many bytes of voxels were read."""
        tell_pass(num_read, num_bytes, what)

    def begin_file(self, path: Path) -> None:
        """Do nothing, as no other process wants to know the file that is read."""


def read_here(reader: str, path: Path, *, on_disk: bool = False, entry: Path | None = None, **arguments: Any) -> Image:
    """Read an image in this process, with the result that `read_isolated` has from a child process."""
    return call_reader(reader, path, arguments, ThisProcess())
