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
from renderer.scene import SplatBudget, with_tolerances

# Arrays of a stage begin at multiples of so many bytes.
ALIGNMENT = 64


def there_and_back(stage: Stage) -> Stage:
    return deserialize_stage(serialize_stage(stage).data)


def assert_same(one: Any, other: Any) -> None:
    """Compare types and values, and of arrays also layout and flags."""
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


def test_arrays_are_aligned_views_of_the_bytes() -> None:
    """No copy is made in any process, and vector instructions can read every array."""
    whole = serialize_stage(stage_of_kind("float32"))
    stage = deserialize_stage(whole.data)
    arrays = [
        stage.layers[0].volume.values,
        stage.layers[0].pyramid.volume.values,
        stage.layers[0].volume.world_from_index,
        stage.order_blending.nearby_from_sphere,
        stage.layers[0].pyramid.occupied,
    ]
    arrays += [array for level in stage.layers[0].pyramid.levels for array in (level.means, level.errors, level.masks)]
    arrays = [array for array in arrays if array.size]
    assert all(np.shares_memory(array, whole) for array in arrays)
    # Relative to the first array: mapped memory begins at a page.
    assert {(array.ctypes.data - whole.ctypes.data) % ALIGNMENT for array in arrays} == {0}


def test_a_volume_is_written_once() -> None:
    """The stage and its pyramid share it."""
    stage = stage_of(SPLATS, waves("float64"))
    num_bytes = serialize_stage(stage).nbytes
    of_voxels = stage.layers[0].volume.values.nbytes
    assert of_voxels < num_bytes < of_voxels + stage.layers[0].pyramid.num_bytes + 2**15


def test_values_that_no_scene_file_has(plain: Stage) -> None:
    """Tolerance 0 beside others, as a budget of splats gives; a file name that is no UTF-8; floats to the last bit."""
    tolerances = {frame: 0.0 if frame < 3 else 0.1 / frame for frame in range(8)}
    scene = with_tolerances(replace(SPLATS, error=replace(SPLATS.error, goal=SplatBudget(9.0))), tolerances)
    scene = replace(scene, output=replace(SPLATS.output, file=Path(os.fsdecode(b"f\xff\xfelm.mp4"))))
    stage = replace(plain, scene=scene, distance=0.1 + 0.2, target=(5e-324, -0.0, 1.7976931348623157e308))
    back = there_and_back(stage)
    assert_same(stage, back)
    assert [number.hex() for number in (back.distance, *back.target)] == [
        number.hex() for number in (stage.distance, *stage.target)
    ]
