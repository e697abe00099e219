"""A stage as one run of bytes, and back: what another process, or another machine, needs to draw a film's frames.

    length of the header, uint64 little-endian | header, JSON | arrays, each at a multiple of ALIGNMENT

The header is the tree of the stage's dataclasses by name; in it an array is its dtype, shape and place. Unpacked arrays
are views of the bytes, so that any number of processes can share them. Only bytes made by this version are to be
unpacked: nothing in them is checked.
"""

from __future__ import annotations

import dataclasses
import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.classify import Classifier, Lighting, Segments
from renderer.depth_directions import Turning
from renderer.drawing import Stage
from renderer.pyramid import Level, Pyramid
from renderer.scene import Scene
from renderer.scene_schema import parse_scene, scene_to_dict
from renderer.volume import Volume

ALIGNMENT = 64

_LENGTH = struct.Struct("<Q")
_RECORDS: dict[str, type[Any]] = {
    kind.__name__: kind for kind in (Stage, Volume, Pyramid, Level, Classifier, Segments, Lighting, Turning)
}


def pack(stage: Stage) -> Iterator[memoryview]:
    """The bytes of a stage, piece by piece; its arrays are not copied."""
    arrays: list[npt.NDArray[Any]] = []
    places: list[int] = []
    tree = _Packer(arrays, places).plain(stage)
    header = json.dumps(tree, ensure_ascii=True).encode()
    yield memoryview(_LENGTH.pack(len(header)))
    yield memoryview(header)
    position = 0
    yield _padding(_LENGTH.size + len(header))
    for array, place in zip(arrays, places, strict=True):
        yield memoryview(bytes(place - position))
        yield array.reshape(-1).view(np.uint8).data
        position = place + array.nbytes


def unpack(content: memoryview) -> Stage:
    """The stage of which these are the bytes. Its arrays are views of `content`, which must be writable."""
    (length,) = _LENGTH.unpack_from(content)
    tree = json.loads(bytes(content[_LENGTH.size : _LENGTH.size + length]))
    end = _LENGTH.size + length
    stage = _unpacked(tree, content[end + len(_padding(end)) :])
    assert isinstance(stage, Stage)
    return stage


def _padding(num_bytes: int) -> memoryview:
    return memoryview(bytes(-num_bytes % ALIGNMENT))


class _Packer:
    """Makes a tree plain; arrays go to the lists."""

    def __init__(self, arrays: list[npt.NDArray[Any]], places: list[int]) -> None:
        self._arrays, self._places, self._end = arrays, places, 0

    def plain(self, value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return self._plain_array(np.ascontiguousarray(value))
        if isinstance(value, Scene):
            return {"Scene": scene_to_dict(value)}
        if type(value).__name__ in _RECORDS:
            return {type(value).__name__: {name: self.plain(item) for name, item in _items(value)}}
        if isinstance(value, tuple):
            return {"tuple": [self.plain(item) for item in value]}
        if isinstance(value, dict):
            return {"dict": {name: self.plain(item) for name, item in value.items()}}
        assert value is None or isinstance(value, (bool, int, float, str, np.generic)), type(value)
        return value.item() if isinstance(value, np.generic) else value

    def _plain_array(self, array: npt.NDArray[Any]) -> dict[str, Any]:
        place = -(-self._end // ALIGNMENT) * ALIGNMENT
        self._end = place + array.nbytes
        self._arrays.append(array)
        self._places.append(place)
        # Compiled code has one version for arrays that may be written to and one for others: they stay as they are.
        facts = {"dtype": array.dtype.str, "shape": array.shape, "place": place, "writeable": array.flags.writeable}
        return {"array": facts}


def _items(record: Any) -> Iterator[tuple[str, Any]]:
    if dataclasses.is_dataclass(record):
        return ((field.name, getattr(record, field.name)) for field in dataclasses.fields(record))
    return iter(record._asdict().items())


def _unpacked(tree: Any, content: memoryview) -> Any:
    if not isinstance(tree, dict):
        return tree
    ((kind, value),) = tree.items()
    if kind == "array":
        return _array(value, content)
    if kind == "Scene":
        return parse_scene(value, base=Path(), still=True)
    if kind == "tuple":
        return tuple(_unpacked(item, content) for item in value)
    items = {name: _unpacked(item, content) for name, item in value.items()}
    return items if kind == "dict" else _RECORDS[kind](**items)


def _array(facts: dict[str, Any], content: memoryview) -> npt.NDArray[Any]:
    shape = tuple(facts["shape"])
    count = int(np.prod(shape, dtype=np.int64))
    array = (
        np.frombuffer(content, np.dtype(facts["dtype"]), count, facts["place"])
        if count
        else np.empty(shape, np.dtype(facts["dtype"]))
    )
    array = array.reshape(shape)
    array.flags.writeable = facts["writeable"]
    return array
