"""Turn a stage into bytes and back, so that another process or machine can draw frames of the film.

    length of the header, uint64 little-endian | header | buffers, each at a multiple of ALIGNMENT

The header is the stage as pickle writes it, and the sizes of its buffers: the arrays, which protocol 5 leaves outside.
Arrays of the result are views of the bytes, which any number of processes can share. Voxels that are mapped from a file
can stay there: the receiver maps the file, too. Only bytes of this version from this program can be read: they are not
checked, and come from the parent process or from Dask, which unpickles messages anyway.
"""

from __future__ import annotations

import io
import pickle
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.frame.stage import Stage
from renderer.volume import MappedCallback, MappedFile

ALIGNMENT = 64

_LENGTH = struct.Struct("<Q")


class _StagePickler(pickle.Pickler):
    """Writes a stage, with its voxels or with the name of the file that they are mapped from."""

    def __init__(self, file: io.BytesIO, buffers: list[pickle.PickleBuffer], stage: Stage, without_files: bool) -> None:
        super().__init__(file, protocol=5, buffer_callback=buffers.append)
        self._volume, self._without_files = stage.volume, without_files

    def persistent_id(self, value: Any) -> MappedFile | None:
        """Return what `_StageUnpickler.persistent_load` makes a value from; None for values that are pickled."""
        is_mapped = self._volume.source is not None and value is self._volume.values
        return self._volume.source if is_mapped and not self._without_files else None

    def reducer_override(self, value: Any) -> Any:
        """Write None in place of a file that the receiver does not have."""
        return (type(None), ()) if self._without_files and isinstance(value, MappedFile) else NotImplemented


class _StageUnpickler(pickle.Unpickler):
    """Reads a stage, and maps its voxels."""

    on_mapped: MappedCallback | None = None

    def persistent_load(self, pid: MappedFile) -> npt.NDArray[Any]:
        """Map the voxels of a file."""
        values = pid.open_array()
        if self.on_mapped is not None:
            self.on_mapped(pid, values)
        return values


def serialize_stage(stage: Stage, *, without_files: bool) -> Iterator[memoryview]:
    """Yield the bytes of a stage, piece by piece. Arrays are not copied, and one that occurs twice is written once.

    Read each piece before asking for the next one: after the last, the volume's file is checked.

    without_files: write all voxels, because the receiver does not have this machine's files. Raises InputError if such
    a file was changed.
    """
    file, buffers = io.BytesIO(), list[pickle.PickleBuffer]()
    _StagePickler(file, buffers, stage, without_files).dump(stage)
    pieces = [buffer.raw() for buffer in buffers]
    header = pickle.dumps((file.getvalue(), [piece.nbytes for piece in pieces]))
    yield memoryview(_LENGTH.pack(len(header)) + header + bytes(_padding_bytes(_LENGTH.size + len(header))))
    for piece in pieces:
        yield piece
        yield memoryview(bytes(_padding_bytes(piece.nbytes)))
    stage.volume.require_unchanged()


def serialized_stage(stage: Stage) -> npt.NDArray[np.uint8]:
    """Return the bytes of a stage, uint8 [n], for a receiver without this machine's files.

    Raises InputError if such a file was changed.
    """
    pieces = [np.frombuffer(piece, np.uint8) for piece in serialize_stage(stage, without_files=True) if piece.nbytes]
    content = np.concatenate(pieces)
    stage.volume.require_unchanged()  # again, because only now all pieces were read
    return content


def deserialize_stage(content: memoryview, on_mapped: MappedCallback | None = None) -> Stage:
    """Return the stage in these bytes, which must be writable. Its arrays are views of them.

    on_mapped: called with the file and the array of voxels that stayed in a file. Raises InputError if that file was
    changed.
    """
    (length,) = _LENGTH.unpack_from(content)
    at = _LENGTH.size + length
    pickled, sizes = pickle.loads(content[_LENGTH.size : at])  # noqa: S301
    buffers = []
    for size in sizes:
        at += _padding_bytes(at)
        buffers.append(content[at : at + size])
        at += size
    unpickler = _StageUnpickler(io.BytesIO(pickled), buffers=buffers)
    unpickler.on_mapped = on_mapped
    stage = unpickler.load()
    assert isinstance(stage, Stage)
    return stage


def _padding_bytes(num_bytes: int) -> int:
    """Return the number of bytes up to the next multiple of ALIGNMENT."""
    return -num_bytes % ALIGNMENT
