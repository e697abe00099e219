"""Zeros at the border of a volume whose air has another value are no background."""

from __future__ import annotations

import numpy as np
import pytest
from kinds_of_data import KINDS, extinction, volume_of

from renderer.statistics import compute_statistics
from renderer.suggest import Suggestion, suggest, suggest_window

AIR = 400


def suggested(values: np.ndarray) -> Suggestion:
    volume = volume_of(values)
    return suggest(volume, compute_statistics(volume.values))


def head() -> np.ndarray:
    """Return a head of magnetic resonance whose air lies around AIR."""
    return KINDS["magnetic resonance"][0] + AIR


def with_rim(values: np.ndarray, thickness: np.ndarray | int, fill: float = 0) -> np.ndarray:
    """Return values with a rim of one value, as thick on each line of voxels as told."""
    values = values.copy()
    for axis in range(3):
        side = values.shape[axis]
        is_rim = np.arange(side)[:, None, None] < thickness
        for step in (1, -1):
            np.moveaxis(values, axis, 0)[::step][np.broadcast_to(is_rim, np.moveaxis(values, axis, 0).shape)] = fill
    return values


@pytest.mark.parametrize("rim", ["even", "ragged"])
def test_zeros_around_the_air_are_no_background(rim: str) -> None:
    """Air is transparent, with them and without; what is in it is shown as without them."""
    thickness = 2 if rim == "even" else np.random.default_rng(1).integers(0, 5, (48, 48))
    padded, plain = suggested(with_rim(head(), thickness)), suggested(head())
    for found in (padded, plain):
        assert extinction(found.transfer, 0, AIR) == [0, 0]
    np.testing.assert_allclose(*(extinction(found.transfer, 700, 1000) for found in (padded, plain)), rtol=0.25)


def test_a_channel_with_zeros_at_its_border_begins_above_its_air() -> None:
    low, _ = suggest_window(volume_of(with_rim(head(), 2)))
    assert low > AIR


@pytest.mark.parametrize("name", ["magnetic resonance", "uint8", "12 bits"])
def test_an_object_in_zeros_is_no_air(name: str) -> None:
    """Zeros that are the air itself stay so, also where the object reaches near to the border."""
    values = KINDS[name][0]
    cleared = np.where(values > np.percentile(values, 60), values, 0)[6:-6, 6:-6, 6:-6]
    found = suggested(np.ascontiguousarray(cleared))
    assert extinction(found.transfer, 0) == [0]
    assert max(extinction(found.transfer, *np.unique(cleared).tolist())) > 0
