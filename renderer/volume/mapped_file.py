"""Files that voxels stay in: mapped into memory, and read page by page when they are looked at.

The system takes such pages back when memory is short, so that a volume may be larger than it. The price is that the
file must stay as it is: a page beyond the end of one that became shorter cannot be read, and the process that tries is
killed (SIGBUS), unless whoever owns the process has it read zeros there (`hsplat_cli/scenes/truncation_guard.py`). So
who is about to read looks at the file first, and who has read looks again before anything comes of it:
`MappedFile.require_unchanged`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError

Array = npt.NDArray[Any]

# Passes over a whole volume look at so much of it at a time, at planes in the whole.
_SLAB_BYTES = 16 << 20

_HINT = "large volumes are read from their files while they are drawn: start again, and let nothing write to this one"


@dataclass(frozen=True)
class MappedFile:
    """Where the voxels [z, y, x] of a volume are in a file, and what the file was when it was opened.

    path: absolute. offset: bytes before the first voxel. dtype: as numpy writes it, with the byte order.
    num_bytes: of the whole file. modified_ns: when it was last written to.
    device, inode: which file it is, whatever its name.
    """

    path: Path
    offset: int
    dtype: str
    shape: tuple[int, ...]
    num_bytes: int
    modified_ns: int
    device: int
    inode: int

    def open_array(self) -> Array:
        """The voxels, read-only. Raises InputError where the file is not what it was."""
        self.require_unchanged()
        return np.asarray(np.memmap(self.path, np.dtype(self.dtype), "r", self.offset, self.shape))

    def require_unchanged(self) -> None:
        """Raise InputError if the file is gone, is another one, has another length, or was written to."""
        try:
            status = self.path.stat()
        except OSError as error:
            raise InputError(
                "the volume's file was taken away while it was in use",
                where=str(self.path),
                got=error.strerror,
                hint=_HINT,
            ) from error
        if (status.st_dev, status.st_ino) != (self.device, self.inode):
            raise InputError(
                "the volume's file was replaced by another while it was in use", where=str(self.path), hint=_HINT
            )
        if status.st_size != self.num_bytes:
            change = "became shorter" if status.st_size < self.num_bytes else "grew"
            raise InputError(
                f"the volume's file {change} while it was in use",
                where=str(self.path),
                got=f"{status.st_size} bytes",
                expected=f"{self.num_bytes} bytes, as when it was opened",
                hint=_HINT,
            )
        if status.st_mtime_ns != self.modified_ns:
            raise InputError("the volume's file was written to while it was in use", where=str(self.path), hint=_HINT)


# What is told of an array that was mapped, of any strides, before it is read.
MappedCallback = Callable[[MappedFile, Array], None]


def backing_file(values: Array) -> MappedFile | None:
    """The file that an array [z, y, x], or the one that it is a part of, is mapped from; None for one in memory.

    values: C-contiguous, or else the file is only to be looked at. Raises OSError where the file is gone.
    """
    base: Any = values
    root: Any = None
    while isinstance(base, np.ndarray):
        if isinstance(base, np.memmap):
            root = base
        base = base.base
    if root is None or root.filename is None:
        return None
    path = Path(root.filename).absolute()
    offset = root.offset + values.__array_interface__["data"][0] - root.__array_interface__["data"][0]
    status = path.stat()
    return MappedFile(
        path=path,
        offset=offset,
        dtype=values.dtype.str,
        shape=values.shape,
        num_bytes=status.st_size,
        modified_ns=status.st_mtime_ns,
        device=status.st_dev,
        inode=status.st_ino,
    )


def iter_slabs(values: Array, source: MappedFile | None, num_bytes: int = _SLAB_BYTES) -> Iterator[Array]:
    """The values [z, y, x], some planes at a time; the file that they are mapped from is looked at before each, and at
    the end."""
    num = max(1, num_bytes // values[0].nbytes)
    for first in range(0, len(values), num):
        if source is not None:
            source.require_unchanged()
        yield values[first : first + num]
    if source is not None:
        source.require_unchanged()
