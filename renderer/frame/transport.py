"""Turn a stage into bytes and back, so that another process or machine can draw frames of the film.

    length of the header, uint64 little-endian | header | buffers, each at a multiple of ALIGNMENT

The header holds the stage as a pickle, and the sizes of its buffers. The buffers are the arrays, which pickle's
protocol 5 leaves out. Arrays of the result are views of the bytes. Voxels that are mapped from a file are sent, too,
because the receiver may not have the file. The bytes are not checked, and must come from the same version of this
program: from Dask, which unpickles messages anyway.
"""

from __future__ import annotations

import io
import pickle
import struct
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.frame.stage import FilmStage
from renderer.volume import MappedFile

# The alignment of buffers, in bytes.
ALIGNMENT = 64

# The format of the header's length: an unsigned little-endian number of 64 bits.
_LENGTH = struct.Struct("<Q")


class _StagePickler(pickle.Pickler):
    """A pickler that leaves out objects for mapped files of this machine, which the receiver may not have."""

    def reducer_override(self, value: Any) -> Any:
        """Return the instructions to write None in place of a mapped file; any other value is pickled as usual."""
        return (type(None), ()) if isinstance(value, MappedFile) else NotImplemented


def serialize_stage(stage: FilmStage) -> npt.NDArray[np.uint8]:
    """Return the bytes of a stage, uint8 [n]. An array that occurs twice is written once.

    Raises InputError if the volume's file was changed.
    """
    file, buffers = io.BytesIO(), list[pickle.PickleBuffer]()
    _StagePickler(file, protocol=5, buffer_callback=buffers.append).dump(stage)
    arrays = [buffer.raw() for buffer in buffers]
    header = pickle.dumps((file.getvalue(), [array.nbytes for array in arrays]))
    pieces = [memoryview(_LENGTH.pack(len(header)) + header), *arrays]
    padded = [part for piece in pieces for part in (piece, memoryview(bytes(_padding_bytes(piece.nbytes))))]
    content = np.concatenate([np.frombuffer(part, np.uint8) for part in padded if part.nbytes])
    stage.require_unchanged()  # checked at the end, when all voxels were read
    return content


def deserialize_stage(content: memoryview) -> FilmStage:
    """Return the stage that `serialize_stage` wrote. Its arrays are views of the bytes, which must be writable."""
    (length,) = _LENGTH.unpack_from(content)
    at = _LENGTH.size + length
    pickled, sizes = pickle.loads(content[_LENGTH.size : at])  # noqa: S301
    buffers = []
    for size in sizes:
        at += _padding_bytes(at)
        buffers.append(content[at : at + size])
        at += size
    stage = pickle.loads(pickled, buffers=buffers)  # noqa: S301
    assert isinstance(stage, FilmStage)
    return stage


def _padding_bytes(num_bytes: int) -> int:
    """Return the number of bytes up to the next multiple of ALIGNMENT."""
    return -num_bytes % ALIGNMENT
