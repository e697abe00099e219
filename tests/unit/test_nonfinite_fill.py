"""The value that stands for NaN and infinities hides nothing, and does not change the suggestion."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from kinds_of_data import KINDS, N, axes, ball

from hsplat_cli.scenes import suggest_scene
from hsplat_cli.terminal import Reporter
from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec
from renderer.suggest import FilmOptions, compute_statistics, suggest
from renderer.suggest.nonfinite import suggest_nonfinite_fill

Array = npt.NDArray[Any]

Z, Y, X = axes()
SLAB = Z < -0.6  # the lowest fifth
TUBE = X**2 + Y**2 > 1  # outside of a scanner's circle
CORNER = (Z > 0.7) & (Y > 0.7) & (X > 0.7)


def with_nan(values: Array, where: Array) -> Array:
    values = values.astype(np.float32)
    values[where] = np.nan
    return values


def found(folder: Path, values: Array) -> tuple[float | None, str]:
    """Return the fill value for NaN, and the kind of data that is recognised with it."""
    np.save(folder / "scan.npy", values)
    source = FileSource(folder / "scan.npy")
    volume = read_volume(VolumeSpec(source, nonfinite="lowest"))
    value = suggest_nonfinite_fill(volume, compute_statistics(volume.values))
    if value is not None:
        volume = read_volume(VolumeSpec(source, nonfinite=value))
    return value, suggest(volume, compute_statistics(volume.values)).kind


def is_seen(folder: Path, values: Array) -> bool:
    np.save(folder / "scan.npy", values)
    volume = VolumeSpec(FileSource(folder / "scan.npy"), nonfinite="lowest")
    film, places = FilmOptions(hides_nonfinite=True), {"scene": folder / "scene.yaml", "output": folder / "film.mp4"}
    note = suggest_scene(volume, film, Reporter(), **places)[1].nonfinite
    assert note is not None and note.startswith(f"{np.isnan(values).sum()} of {values.size} ")
    return not note.endswith("which is not seen")


@pytest.mark.parametrize("where", [SLAB, CORNER], ids=["slab", "corner"])
@pytest.mark.parametrize("name", ["signed", "filled, signed", "distance", "distance, reversed", "head as float32"])
def test_the_kind_is_that_of_the_others(tmp_path: Path, name: str, where: Array) -> None:
    values = with_nan(KINDS[name][0], where)
    assert found(tmp_path, values)[1] == KINDS[name][1]
    assert not is_seen(tmp_path, values)


# Not of the room with a hot spot: its floor and its ceiling have one temperature each, as backgrounds have.
@pytest.mark.parametrize("name", [name for name in KINDS if name not in ("constant", "temperature")])
def test_nan_are_not_seen(tmp_path: Path, name: str) -> None:
    values = KINDS[name][0].astype(np.float64)
    values[X**2 + Y**2 + Z**2 > 0.9] = np.nan  # all around
    assert not is_seen(tmp_path, values)


def test_a_signed_field_inside_of_nan_keeps_its_signs(tmp_path: Path) -> None:
    values = with_nan(KINDS["filled, signed"][0], X**2 + Y**2 + Z**2 > 0.9)
    assert found(tmp_path, values) == (0.0, "field with two signs")


@pytest.mark.parametrize("where", [SLAB, TUBE], ids=["slab", "tube"])
def test_a_bright_background_goes_on_where_nan_are(tmp_path: Path, where: Array) -> None:
    values = KINDS["dark object"][0]
    background = float(np.median(values[0]))
    value, kind = found(tmp_path, with_nan(values, where))
    assert value == pytest.approx(background, abs=3)
    assert kind.endswith("dark in a bright background")


def test_nan_around_labels_are_their_background(tmp_path: Path) -> None:
    values = KINDS["labels"][0]
    assert found(tmp_path, with_nan(values, values == 0)) == (0.0, "labels")
    assert found(tmp_path, with_nan(values, SLAB)) == (None, "labels")  # 0 is there already


@pytest.mark.parametrize("value", [1.0, -3.0])
def test_nan_make_a_mask(tmp_path: Path, value: float) -> None:
    values = with_nan(np.full((N, N, N), value), ~ball((0, 0, 0), 0.6))
    assert found(tmp_path, values) == (0.0, "mask")
    assert not is_seen(tmp_path, values)


def test_a_background_of_the_lowest_value_is_not_taken_for_nan(tmp_path: Path) -> None:
    """A few NaN become 0, which remains the background."""
    values = np.maximum(KINDS["uint8"][0].astype(float) - 30, 0)
    without = found(tmp_path, values)[1]
    values[20, 20, 20:30] = np.nan
    assert found(tmp_path, values) == (None, without)
