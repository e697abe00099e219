"""Voxels as they are classified, against rational arithmetic."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
from extremes import Measure, Random, worst_of
from number_types import INTEGERS, limits

from renderer.pyramid import build_pyramid, cut_pyramid
from renderer.scene import ErrorSpec, PyramidSpec
from renderer.transfer import TransferFunction
from renderer.volume import Array, Float64, Volume, make_volume


def placed(values: Array, axes: Float64) -> Volume:
    """Return a volume around the world's origin."""
    world_from_index = np.eye(4)
    world_from_index[:3, :3] = axes
    world_from_index[:3, 3] = -axes @ ((np.array(values.shape[::-1]) - 1) / 2)
    return make_volume(np.ascontiguousarray(values), world_from_index, "extreme")


def exactly(by: TransferFunction) -> Callable[[Any], list[Fraction]]:
    """Return a function from a scalar to (tau c, tau): linear, of equal points the last, constant outside."""
    rows = [[Fraction(float(v)) for v in (*color, tau)] for color, tau in zip(by.colors, by.extinctions, strict=True)]
    at = [Fraction(float(value)) for value in by.values]

    def channels(scalar: Any) -> list[Fraction]:
        s = Fraction(int(scalar)) if isinstance(scalar, np.integer) else Fraction(float(scalar))
        above = bisect_right(at, s)
        row = rows[min(above, len(at) - 1)]
        if 0 < above < len(at):
            t = (s - at[above - 1]) / (at[above] - at[above - 1])
            row = [low + t * (high - low) for low, high in zip(rows[above - 1], rows[above], strict=True)]
        return [*(channel * row[3] for channel in row[:3]), row[3]]

    return channels


def worst_classified(by: TransferFunction, values: Array) -> float:
    """Return the largest error of a channel of any voxel, as a share of the largest extinction; the spacing is 1."""
    of = placed(values.reshape(1, 1, -1), np.eye(3))
    cut = cut_pyramid(build_pyramid(of, by, spec=PyramidSpec(), error=ErrorSpec()), 0.0)  # all visible voxels
    found, exact, worst = np.zeros((len(values), 4)), exactly(by), 0.0
    found[cut.cells[:, 0]] = cut.depths
    for got, scalar in zip(found, of.values[0, 0], strict=True):
        worst = max(worst, *(abs(float(Fraction(float(a)) - b)) for a, b in zip(got, exact(scalar), strict=True)))
    return worst / by.max_extinction


def about(values: Float64, dtype: str, rng: Random) -> Array:
    """Return scalars of a type at control values, next to them and between them, and its limits."""
    low, high = limits(dtype)
    ends = np.array([low, high], dtype)
    fine = np.sort(np.clip(values, float(low), float(high)))
    between = fine[:-1] + rng.random((4, len(fine) - 1)) * (fine[1:] / 2 - fine[:-1] / 2)
    near = np.concatenate([fine, between.ravel()])
    if dtype in INTEGERS:
        near = np.clip(np.concatenate([np.floor(near), np.ceil(near)]), low + 1, high / 2)
        return np.concatenate([ends, near.astype(dtype)])
    typed = near.astype(dtype)
    steps = np.concatenate([np.nextafter(typed, ends[0]), np.nextafter(typed, ends[1])])
    return np.concatenate([ends, typed, steps[np.isfinite(steps)]])


def classified(dtypes: tuple[str, ...], points: Callable[[Random], Any]) -> Measure:
    """Return the measure of functions of random colours and extinctions at the given control values."""

    def error(rng: Random, case: int) -> float:
        values = np.array(points(rng), np.float64)
        by = TransferFunction(values, rng.random((len(values), 3)), rng.random(len(values)) * 5, 1.0)
        return worst_classified(by, about(values, dtypes[case % len(dtypes)], rng))

    return worst_of(error)
