"""Planes clip away what lies around the object, and nothing of the object."""

from __future__ import annotations

import numpy as np
import pytest
from kinds_of_data import Array, axes, ball, blurred, extinction, noise, sample_of, suggested

from renderer.statistics import are_deep
from renderer.suggest import are_beyond, corner_box, separating_planes
from renderer.volume import Bools

N = 64


def clipped_away(shown: Bools) -> Array:
    """Return what the planes clip away."""
    sample = sample_of(shown.astype(np.uint8))
    return are_beyond(sample, separating_planes(sample, shown))


def head() -> Bools:
    return ball((0, -0.1, 0), 0.5, N)


def table() -> Bools:
    _, y, x = axes(N)
    return (np.abs(y - 0.7) < 0.05) & (np.abs(x) < 0.8)


def curved_holder() -> Bools:
    _, y, x = axes(N)
    radius = np.hypot(x, y + 0.1)
    return (radius > 0.75) & (radius < 0.82) & (y > 0.2)


def leg() -> Bools:
    z, y, _ = axes(N)
    return (np.abs(z) < 0.04) & (np.abs(y) < 0.04)


def touching_table() -> Bools:
    _, y, x = axes(N)
    return (np.abs(y - 0.45) < 0.06) & (np.abs(x) < 0.8)


@pytest.mark.parametrize(
    "beside", [table, curved_holder, touching_table], ids=["table", "holder", "table that touches the object"]
)
def test_a_sheet_that_reaches_the_border_is_clipped_away(beside) -> None:
    gone = clipped_away(head() | beside())
    assert gone[beside()].mean() > 0.8
    assert gone[head()].mean() < 0.01  # about a layer of voxels where they touch


def test_specks_far_away_are_clipped_away() -> None:
    shown = head()
    specks = np.zeros_like(shown)
    specks[[2, 60, 3, 61], [3, 58, 60, 2], [60, 61, 2, 5]] = True
    gone = clipped_away(shown | specks)
    assert gone[specks].all() and not gone[shown].any()


@pytest.mark.parametrize(
    "shown",
    [
        head(),
        head() | ball((0.7, 0.7, 0.7), 0.2, N),  # a second object
        head() | leg(),
        head() | (leg() & (axes(N)[2] * 20 % 2 > 1)),  # a leg in pieces
        ball((0, 0, 0), 0.15, N) | table(),  # a sheet that is larger than the rest
        table(),  # nothing but a sheet
        np.indices((N, N, N))[0] > 0,
    ],
    ids=["alone", "two", "leg", "broken leg", "plate", "sheet", "filled"],
)
def test_nothing_of_objects_is_clipped_away(shown: Bools) -> None:
    assert not clipped_away(shown).any()


def test_nothing_visible_has_no_planes() -> None:
    assert separating_planes(sample_of(head().astype(np.uint8)), np.zeros((N, N, N), bool)) == []


def test_deep_voxels_lie_below_the_surface() -> None:
    deep = are_deep(sample_of(head().astype(np.uint8)), head())
    assert deep[ball((0, -0.1, 0), 0.3, N)].all() and not deep[~ball((0, -0.1, 0), 0.48, N)].any()


def test_a_corner_is_an_eighth_of_the_object() -> None:
    low, high = corner_box(sample_of(head().astype(np.uint8)), head())
    z, y, x = axes(N)
    inside = np.ones_like(head())
    for axis, at in enumerate((x, y, z)):
        inside &= (at * (N - 1) / 2 >= low[axis]) & (at * (N - 1) / 2 <= high[axis])
    assert (inside & head()).sum() == pytest.approx(head().sum() / 8, rel=0.1)
    assert not inside[y > 0].any() and not inside[x < -0.1].any() and not inside[z < -0.1].any()


def in_a_medium(form: str, level: float, spread: float) -> np.ndarray:
    """Return a body with claws of 0.7 to 1, in air or in an even medium within air, with noise."""
    z, y, x = axes(N)
    inside = {
        "ball": x**2 + y**2 + z**2 < 0.9,
        "cylinder": (x**2 + y**2 < 0.85) & (abs(z) < 0.8),
        "box": (abs(x) < 0.9) & (abs(y) < 0.9) & (abs(z) < 0.7),
    }[form]
    values = np.where(inside, level, 0.0)
    values[(x / 0.55) ** 2 + (y / 0.2) ** 2 + (z / 0.2) ** 2 < 1] = 0.8
    values[(abs(x) < 0.1) & (abs(y) < 0.45) & (abs(z) < 0.1)] = 0.7
    values[(x - 0.5) ** 2 + y**2 + z**2 < 0.03] = 1.0
    return blurred(values) + spread * noise(9, N)


@pytest.mark.parametrize(
    ("form", "level", "spread"),
    [("ball", 0.35, 0.03), ("ball", 0.2, 0.02), ("cylinder", 0.45, 0.03), ("cylinder", 0.2, 0.02),
        ("box", 0.35, 0.015)],
)  # fmt: skip
def test_an_even_medium_around_an_object_is_background(form: str, level: float, spread: float) -> None:
    values = in_a_medium(form, level, spread)
    found = suggested(values)
    assert "an even medium near" in found.reason
    assert extinction(found.transfer, 0.0, level) == [0, 0]
    assert min(extinction(found.transfer, 0.8, 1.0)) > 0


def test_tissue_around_bone_is_no_medium() -> None:
    """It is not even; or it is enclosed by what is denser."""
    z, y, x = axes(N)
    radius, waves = np.sqrt(x**2 + y**2 + z**2), np.sin(9 * x + 3 * y) * np.cos(8 * z - y)
    flesh = np.where(radius < 0.85, 0.4 + 0.06 * waves, 0.0)
    flesh[radius < 0.3] = 0.9
    skull = np.where(radius < 0.85, 0.9, 0.0)
    skull[radius < 0.72] = 0.4
    fat = np.where(radius < 0.85, 0.3, 0.0)
    fat[radius < 0.7] = 0.6 + 0.03 * waves[radius < 0.7]
    fat[radius < 0.2] = 1.0
    for values, at in ((flesh, 0.4), (skull, 0.4), (fat, 0.3)):
        found = suggested(blurred(values) + 0.02 * noise(9, N))
        assert "medium" not in found.reason
        assert min(extinction(found.transfer, at + 0.05, 0.9)) > 0
