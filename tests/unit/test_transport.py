"""A stage as bytes and back is the same stage, bit for bit, and shares the memory of the bytes."""

from __future__ import annotations

import dataclasses
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from film_stages import KINDS, SPLATS, stage_of, stage_of_kind, waves

from renderer.frame import Stage, deserialize_stage, serialize_stage
from renderer.frame.transport import ALIGNMENT
from renderer.scene import SplatBudget, with_tolerances


def there_and_back(stage: Stage) -> Stage:
    return deserialize_stage(memoryview(bytearray(b"".join(serialize_stage(stage, without_files=False)))))


def assert_same(one: Any, other: Any) -> None:
    """In type and value, arrays in their layout and what may be done to them, too."""
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        assert one.flags.writeable == other.flags.writeable
        assert other.flags.c_contiguous and other.flags.aligned
        assert one.tobytes() == other.tobytes()
    elif dataclasses.is_dataclass(one):
        for field in dataclasses.fields(one):
            assert_same(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for item, other_item in zip(one, other, strict=True):
            assert_same(item, other_item)
    elif isinstance(one, dict):
        assert list(one) == list(other)
        assert_same(tuple(one.values()), tuple(other.values()))
    else:
        assert one == other


@pytest.fixture(scope="module")
def plain() -> Stage:
    return stage_of(SPLATS)


@pytest.mark.parametrize("kind", KINDS)
def test_there_and_back(kind: str) -> None:
    stage = stage_of_kind(kind)
    assert_same(stage, there_and_back(stage))


def test_arrays_are_views_of_the_bytes(plain: Stage) -> None:
    """No copy is made in any process."""
    content = memoryview(bytearray(b"".join(serialize_stage(plain, without_files=False))))
    stage = deserialize_stage(content)
    whole = np.frombuffer(content, np.uint8)
    for array in (stage.volume.values, stage.pyramid.volume.values, stage.pyramid.levels[0].means):
        assert np.shares_memory(array, whole)


def test_every_array_begins_where_vectors_may() -> None:
    """Relative to the first one, and so wherever memory that is mapped begins."""
    content = np.frombuffer(
        bytearray(b"".join(serialize_stage(stage_of_kind("float32"), without_files=False))), np.uint8
    )
    stage = deserialize_stage(memoryview(content))
    first = content.ctypes.data
    arrays = [
        stage.volume.values,
        stage.volume.world_from_index,
        stage.order_blending.nearby_from_sphere,
        stage.pyramid.occupied,
    ]
    arrays += [array for level in stage.pyramid.levels for array in (level.means, level.errors, level.masks)]
    assert {(array.ctypes.data - first) % ALIGNMENT for array in arrays if array.size} == {0}


def test_a_volume_is_there_once() -> None:
    """A stage has it, and so has its pyramid."""
    stage = stage_of(SPLATS, waves("float64"))
    num_bytes = sum(len(piece) for piece in serialize_stage(stage, without_files=False))
    assert stage.volume.values.nbytes < num_bytes < stage.volume.values.nbytes + stage.pyramid.num_bytes + 2**15


def test_a_schedule_that_nobody_could_write(plain: Stage) -> None:
    """A budget of splats that some frames can have all of: tolerance 0 beside others."""
    tolerances = {frame: 0.0 if frame < 3 else 0.1 / frame for frame in range(8)}
    scene = with_tolerances(replace(SPLATS, error=replace(SPLATS.error, goal=SplatBudget(((0, 9.0),)))), tolerances)
    stage = replace(plain, scene=scene)
    assert_same(stage, there_and_back(stage))


def test_names_of_files_that_are_no_text(plain: Stage) -> None:
    """As another system's disk may have them."""
    output = replace(SPLATS.output, file=Path(os.fsdecode(b"f\xff\xfelm.mp4")))
    stage = replace(plain, scene=replace(SPLATS, output=output))
    back = there_and_back(stage).scene.output.file
    assert os.fsencode(back) == b"f\xff\xfelm.mp4"


def test_numbers_keep_every_digit(plain: Stage) -> None:
    stage = replace(plain, distance=0.1 + 0.2, target=(5e-324, -0.0, 1.7976931348623157e308))
    back = there_and_back(stage)
    assert [number.hex() for number in (back.distance, *back.target)] == [
        number.hex() for number in (stage.distance, *stage.target)
    ]
