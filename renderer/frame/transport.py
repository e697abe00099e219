"""Turn a stage into bytes and back, so that another process or machine can draw frames of the film.

    length of the header, uint64 little-endian | header, JSON | arrays, each at a multiple of ALIGNMENT

The header is the tree of the stage's dataclasses by name, in which an array is its dtype, shape and offset. Arrays of
the result are views of the bytes, which any number of processes can share. Voxels that are mapped from a file can stay
there: the receiver maps the file, too. Only bytes from this version can be read, because they are not checked.
"""

from __future__ import annotations

import dataclasses
import json
import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.bricks import BrickLevel, Bricks
from renderer.frame.stage import Stage
from renderer.pyramid import FinestCut, Level, Pyramid
from renderer.scene import spec_types
from renderer.transfer import Classifier, PiecewiseTransfer, TransferFunction, TransferTable, VoxelLighting
from renderer.view import OrderBlending
from renderer.volume import MappedCallback, MappedFile, Volume

Array = npt.NDArray[Any]

ALIGNMENT = 64

_LENGTH = struct.Struct("<Q")
# Every type in a stage, by name. A scene is rebuilt field by field, not parsed from plain data: the schedule of a
# resolved goal need not be one that a user may write.
_STAGE_TYPES = (
    Stage, Volume, MappedFile, Pyramid, FinestCut, Level, Classifier, TransferTable, VoxelLighting, OrderBlending,
    Bricks, BrickLevel, PiecewiseTransfer, TransferFunction,
)  # fmt: skip
_TYPES_BY_NAME: dict[str, type[Any]] = {kind.__name__: kind for kind in (*_STAGE_TYPES, *spec_types())}


def serialize_stage(stage: Stage, *, without_files: bool) -> Iterator[memoryview]:
    """Yield the bytes of a stage, piece by piece. Arrays are not copied, and one that occurs twice is written once.

    Read each piece before asking for the next one: after the last, the volume's file is checked.

    without_files: write all voxels, because the receiver does not have this machine's files. Raises InputError if such
    a file was changed.
    """
    arrays = _ArrayLayout(without_files)
    header = json.dumps(_to_json_tree(stage, arrays)).encode("ascii")
    yield memoryview(_LENGTH.pack(len(header)))
    yield memoryview(header)
    yield memoryview(bytes(_padding_bytes(_LENGTH.size + len(header))))
    for array in arrays.contiguous_arrays():
        yield array.reshape(-1).view(np.uint8).data
        yield memoryview(bytes(_padding_bytes(array.nbytes)))
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
    end = _LENGTH.size + length
    tree = json.loads(bytes(content[_LENGTH.size : end]))
    stage = _from_json_tree(tree, content[end + _padding_bytes(end) :], on_mapped)
    assert isinstance(stage, Stage)
    return stage


def _padding_bytes(num_bytes: int) -> int:
    """Return the number of bytes up to the next multiple of ALIGNMENT."""
    return -num_bytes % ALIGNMENT


class _ArrayLayout:
    """The offsets of arrays, one behind the other. without_files: voxels that are in files are among them."""

    def __init__(self, without_files: bool) -> None:
        self.without_files = without_files
        self._end = 0
        # By identity: the array, which keeps its identity in use, its contiguous form and its offset.
        self._placed: dict[int, tuple[Array, Array, int]] = {}

    def offset_of(self, array: Array) -> int:
        """Return the offset of an array from the first one, in bytes; append it if it is new."""
        if id(array) not in self._placed:
            contiguous = np.ascontiguousarray(array)
            self._placed[id(array)] = array, contiguous, self._end
            self._end += contiguous.nbytes + _padding_bytes(contiguous.nbytes)
        return self._placed[id(array)][2]

    def contiguous_arrays(self) -> Iterator[Array]:
        """Yield all arrays, as they are written."""
        return (contiguous for _, contiguous, _ in self._placed.values())


def _to_json_tree(value: Any, arrays: _ArrayLayout) -> Any:
    """Return a value as JSON, in which a dictionary has one key, the kind of its value."""
    if isinstance(value, np.ndarray):
        # Compiled loops have separate versions for writable and read-only arrays.
        facts = {"dtype": value.dtype.str, "shape": value.shape, "writeable": value.flags.writeable}
        return {"array": facts | {"offset": arrays.offset_of(value)}}
    if isinstance(value, Path):
        return {"Path": str(value)}
    if isinstance(value, Volume) and value.source is not None:
        if not arrays.without_files:
            return {"mapped": {name: _to_json_tree(item, arrays) for name, item in _items(value) if name != "values"}}
        value = replace(value, source=None)
    if type(value).__name__ in _TYPES_BY_NAME:
        return {type(value).__name__: {name: _to_json_tree(item, arrays) for name, item in _items(value)}}
    if isinstance(value, tuple):
        return {"tuple": [_to_json_tree(item, arrays) for item in value]}
    if isinstance(value, dict):
        return {"dict": {name: _to_json_tree(item, arrays) for name, item in value.items()}}
    assert value is None or type(value) in (bool, int, float, str), type(value)
    return value


def _items(record: Any) -> Iterator[tuple[str, Any]]:
    if dataclasses.is_dataclass(record):
        return ((field.name, getattr(record, field.name)) for field in dataclasses.fields(record))
    return iter(record._asdict().items())


def _from_json_tree(tree: Any, content: memoryview, on_mapped: MappedCallback | None) -> Any:
    if not isinstance(tree, dict):
        return tree
    ((kind, value),) = tree.items()
    if kind == "array":
        array: Array = np.ndarray(value["shape"], value["dtype"], content, value["offset"])
        array.flags.writeable = value["writeable"]
        return array
    if kind == "Path":
        return Path(value)
    if kind == "tuple":
        return tuple(_from_json_tree(item, content, on_mapped) for item in value)
    items = {name: _from_json_tree(item, content, on_mapped) for name, item in value.items()}
    if kind == "mapped":
        values = items["source"].open_array()
        if on_mapped is not None:
            on_mapped(items["source"], values)
        return Volume(values=values, **items)
    return items if kind == "dict" else _TYPES_BY_NAME[kind](**items)
