"""Stores are read as their arrays and metadata say: levels, places, axes, channels, labels, times and crops."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from store_files import (
    field,
    halves,
    scaled,
    write_ome,
)
from volume_files import read

from renderer.volume import Volume

FIELD = field()
LEVELS = [FIELD, halves(FIELD, 1, 2, 2), halves(FIELD, 3, 6, 6)]
# Scale factors 1:2:2 and 3:6:6, with the shift of the centre of the first block.
PLACES = [
    scaled(2.0, 0.5, 0.5, translation=(10.0, 20.0, 30.0)),
    scaled(2.0, 1.0, 1.0, translation=(10.0, 20.25, 30.25)),
    scaled(6.0, 3.0, 3.0, translation=(12.0, 21.25, 31.25)),
]


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch, one_process: None) -> None:
    """Read stores in this process, which is quicker."""


@pytest.fixture
def store(tmp_path: Path) -> Path:
    return write_ome(tmp_path / "a.ome.zarr", LEVELS, PLACES)


def _place(volume: Volume) -> tuple[list[float], list[float]]:
    return volume.spacing.tolist(), volume.world_from_index[:3, 3].tolist()


def _is(volume: Volume, values: Any) -> bool:
    np.testing.assert_array_equal(volume.values, values)
    return volume.values.dtype == values.dtype


@pytest.mark.parametrize("version", ["0.4", "0.5"])
@pytest.mark.parametrize("number", [0, 1, 2])
def test_each_level_has_its_voxels_and_its_place(tmp_path: Path, version: str, number: int, here: None) -> None:
    folder = write_ome(tmp_path / "a", LEVELS, PLACES, version=version)
    volume = read(folder, level=number)
    assert _is(volume, LEVELS[number]) and volume.length_unit == "µm"
    spacing, origin = ([0.5, 0.5, 2], [1, 1, 2], [3, 3, 6])[number], PLACES[number][1]["translation"][::-1]
    assert _place(volume) == (spacing, origin)
    assert [each.shape for each in volume.levels] == [each.shape[::-1] for each in LEVELS]
    assert [each.is_read for each in volume.levels] == [k == number for k in range(3)]
    assert volume.levels[0].chunks == (5, 5, 5) and volume.levels[0].num_bytes == FIELD.nbytes


def test_a_store_is_read_in_a_child_process(store: Path) -> None:
    volume = read(store, crop=((3, 9), None, None), level=1, spacing=(1.0, 1.0, 2.0))
    assert _is(volume, LEVELS[1][:, :, 1:5]) and volume.levels[1].is_read
    assert _place(volume) == ([2, 2, 2], [30 + 0.5 + 2, 20 + 0.5, 10])
    assert volume.file_spacing == (0.5, 0.5, 2.0)
