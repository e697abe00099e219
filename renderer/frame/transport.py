"""A stage as one run of bytes, and back: what another process, or another machine, needs to draw a film's frames.

    length of the header, uint64 little-endian | header, JSON | arrays, each at a multiple of ALIGNMENT

The header is the tree of the stage's dataclasses by name; in it an array is its dtype, shape and place. Unpacked arrays
are views of the bytes, so that any number of processes can share them. Voxels that are mapped from a file can be left
there: who unpacks the stage maps them, too. Only bytes made by this version are to be unpacked: nothing in them is
checked.
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
from renderer.frame.frame import Stage
from renderer.pyramid import Level, Pyramid
from renderer.scene import SPEC_TYPES
from renderer.transfer import Classifier, Lighting, PiecewiseTransfer, TransferFunction, TransferSegments
from renderer.view import OrderBlending
from renderer.volume import MappedCallback, MappedFile, Volume

Array = npt.NDArray[Any]

ALIGNMENT = 64

_LENGTH = struct.Struct("<Q")
# Everything that a stage is made of, by name. A scene is taken as it is and not read again from plain data: the
# schedule of one whose goal was resolved need not be one that a user may write.
_STAGE_TYPES = (
    Stage, Volume, MappedFile, Pyramid, Level, Classifier, TransferSegments, Lighting, OrderBlending, Bricks,
    BrickLevel,     PiecewiseTransfer, TransferFunction,
)  # fmt: skip
_TYPES_BY_NAME: dict[str, type[Any]] = {kind.__name__: kind for kind in (*_STAGE_TYPES, *SPEC_TYPES)}


def serialize_stage(stage: Stage, *, without_files: bool) -> Iterator[memoryview]:
    """The bytes of a stage, piece by piece; its arrays are not copied, and one that it has twice is there once.

    A piece is to be read before the next one is asked for: after the last the volume's file is looked at.

    without_files: who unpacks it does not have the files of this machine: all voxels are in the bytes. Raises
    InputError where such a file was changed.
    """
    arrays = _ArrayLayout(without_files)
    header = json.dumps(_plain(stage, arrays)).encode("ascii")
    yield memoryview(_LENGTH.pack(len(header)))
    yield memoryview(header)
    yield memoryview(bytes(_padding_bytes(_LENGTH.size + len(header))))
    for array in arrays.in_order():
        yield array.reshape(-1).view(np.uint8).data
        yield memoryview(bytes(_padding_bytes(array.nbytes)))
    stage.volume.require_unchanged()


def serialized_stage(stage: Stage) -> npt.NDArray[np.uint8]:
    """uint8 [n]: the bytes of a stage for who does not have the files of this machine. Raises InputError where such a
    file was changed."""
    pieces = [np.frombuffer(piece, np.uint8) for piece in serialize_stage(stage, without_files=True) if piece.nbytes]
    content = np.concatenate(pieces)
    stage.volume.require_unchanged()  # once more: they were not read before
    return content


def deserialize_stage(content: memoryview, on_mapped: MappedCallback | None = None) -> Stage:
    """The stage of which these are the bytes. Its arrays are views of `content`, which must be writable.

    on_mapped: told of all voxels that were left in a file.

    Raises InputError where voxels were left in a file and that is not what it was.
    """
    (length,) = _LENGTH.unpack_from(content)
    end = _LENGTH.size + length
    stage = _unpacked(json.loads(bytes(content[_LENGTH.size : end])), content[end + _padding_bytes(end) :], on_mapped)
    assert isinstance(stage, Stage)
    return stage


def _padding_bytes(num_bytes: int) -> int:
    """Bytes from the end of so many to the next multiple of ALIGNMENT."""
    return -num_bytes % ALIGNMENT


class _ArrayLayout:
    """Where arrays go, one behind the other; without_files: voxels that are in files, too."""

    def __init__(self, without_files: bool) -> None:
        self.without_files = without_files
        self._end = 0
        self._placed: dict[int, tuple[Array, Array, int]] = {}  # by identity: the array, as it is packed, and its place

    def place(self, array: Array) -> int:
        """Bytes from the beginning of the first one."""
        if id(array) not in self._placed:
            serialized_stage = np.ascontiguousarray(array)
            self._placed[id(array)] = array, serialized_stage, self._end
            self._end += serialized_stage.nbytes + _padding_bytes(serialized_stage.nbytes)
        return self._placed[id(array)][2]

    def in_order(self) -> Iterator[Array]:
        """All of them, as they are packed."""
        return (serialized_stage for _, serialized_stage, _ in self._placed.values())


def _plain(value: Any, arrays: _ArrayLayout) -> Any:
    """What JSON can hold of a value; a dictionary has one key, the kind."""
    if isinstance(value, np.ndarray):
        # Compiled code has one version for arrays that may be written to and one for others: they stay as they are.
        facts = {"dtype": value.dtype.str, "shape": value.shape, "writeable": value.flags.writeable}
        return {"array": facts | {"place": arrays.place(value)}}
    if isinstance(value, Path):
        return {"Path": str(value)}
    if isinstance(value, Volume) and value.source is not None:
        if not arrays.without_files:
            return {"mapped": {name: _plain(item, arrays) for name, item in _items(value) if name != "values"}}
        value = replace(value, source=None)
    if type(value).__name__ in _TYPES_BY_NAME:
        return {type(value).__name__: {name: _plain(item, arrays) for name, item in _items(value)}}
    if isinstance(value, tuple):
        return {"tuple": [_plain(item, arrays) for item in value]}
    if isinstance(value, dict):
        return {"dict": {name: _plain(item, arrays) for name, item in value.items()}}
    assert value is None or type(value) in (bool, int, float, str), type(value)
    return value


def _items(record: Any) -> Iterator[tuple[str, Any]]:
    if dataclasses.is_dataclass(record):
        return ((field.name, getattr(record, field.name)) for field in dataclasses.fields(record))
    return iter(record._asdict().items())


def _unpacked(tree: Any, content: memoryview, on_mapped: MappedCallback | None) -> Any:
    if not isinstance(tree, dict):
        return tree
    ((kind, value),) = tree.items()
    if kind == "array":
        array: Array = np.ndarray(value["shape"], value["dtype"], content, value["place"])
        array.flags.writeable = value["writeable"]
        return array
    if kind == "Path":
        return Path(value)
    if kind == "tuple":
        return tuple(_unpacked(item, content, on_mapped) for item in value)
    items = {name: _unpacked(item, content, on_mapped) for name, item in value.items()}
    if kind == "mapped":
        values = items["source"].open_array()
        if on_mapped is not None:
            on_mapped(items["source"], values)
        return Volume(values=values, **items)
    return items if kind == "dict" else _TYPES_BY_NAME[kind](**items)
