"""Sub-voxel variation equals Simpson's rule and a dense reference, and pictures of it meet the tolerance."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from brick_reference import rasterize_bricks_reference
from brickwork import AFFINES, EXACTLY, bricks_of, placed, transfer_of, view_of
from dense_bricks import (
    between_scalars,
    channels_of,
)

from renderer.bricks import Bricks, cut_bricks, make_brick_batch
from renderer.bricks.subvoxel import (
    DIFFERENCE_ERROR_SHARE,
    MIN_PEAK_WIDTH,
    SIMPLIFICATION_TOLERANCE,
    make_channel_curve,
    squared_difference,
    squared_distance,
)
from renderer.transfer import TransferFunction, TransferTable
from renderer.truth import integrate
from renderer.view import View, visible_bricks
from renderer.volume import Volume, make_volume

Float64 = npt.NDArray[np.float64]

COLOR = (0.2, 0.7, 1.0)


# Thinned lines have D within so much of the exact one, in units of the largest channel.
THINNED = 4 * SIMPLIFICATION_TOLERANCE


def curve_of(transfer: TransferFunction, low: float, high: float, *, opacity: bool = False) -> TransferTable:
    return make_channel_curve(transfer, 1.0, opacity, 1.0, (low, high))


def control_points(curve: TransferTable) -> tuple[Float64, Float64]:
    """Return the scaled control values [n] and the channels at them [n, 4]."""
    return curve.rows[1:, 0].copy(), curve.rows[1:, 2:6]


def found(line: TransferTable, low: float, high: float) -> tuple[float, float]:
    """Return D^2 and width^2."""
    first = int(np.searchsorted(control_points(line)[0], low * line.scale, side="right"))
    return squared_distance(low * line.scale, high * line.scale, first, control_points(line)[0], line.rows)


def random_steps(rng: np.random.Generator, colors: int) -> TransferFunction:
    """Return up to nine control values from 0 to 1 of some colours, among them steps and spikes without any width."""
    num = int(rng.integers(1, 10))
    values = np.sort(rng.choice(np.arange(9) / 8, num))
    color = rng.random((colors, 3))
    return TransferFunction(values, color[rng.integers(0, colors, num)], rng.choice([0.0, 0.3, 2.0], num), 1.0)


def random_ranges(rng: np.random.Generator) -> Float64:
    """Return ranges [20, 2] from -1/4 to 5/4, many of which end at a control value or just beside one."""
    ends = rng.choice(np.arange(-4, 21) / 16, (20, 2)) + rng.choice([0, 0.01], (20, 2))
    return np.sort(ends[ends[:, 0] != ends[:, 1]], axis=1)


def test_distance_and_width_equal_simpsons_rule() -> None:
    """They hold for any colours; hardly any control point is left out."""
    for seed in range(50):
        rng = np.random.default_rng(seed)
        transfer = random_steps(rng, 9)
        line, points = curve_of(transfer, -1, 2), channels_of(transfer, 1.0)
        for low, high in random_ranges(rng):
            square, _, jump = between_scalars(np.array(low), np.array(high), transfer.values, points)
            _, width, _ = between_scalars(np.array(low), np.array(high), *control_points(line))
            got = found(line, low, high)
            np.testing.assert_allclose(math.sqrt(got[0]), math.sqrt(square), rtol=1e-9, atol=1e-12)
            assert got[1] == pytest.approx(float(width), rel=1e-9) or square < 1e-20
            assert MIN_PEAK_WIDTH**2 <= got[1] <= 1
            nums = (int(np.searchsorted(control_points(line)[0], at * line.scale, side="right")) for at in (low, high))
            difference = squared_difference(low * line.scale, high * line.scale, *nums, line.rows)
            np.testing.assert_allclose(DIFFERENCE_ERROR_SHARE**2 * difference, jump, rtol=1e-9, atol=1e-12)


def test_variation_is_0_without_a_control_value_between() -> None:
    """Exactly, also where control values are the ends; but for a step at the higher one, which the field comes to from
    below."""
    rng = np.random.default_rng(1)
    values = np.array([0.1, 0.3, 0.3, 0.7, 0.9])
    transfer = TransferFunction(values, rng.random((5, 3)), rng.random(5), 1.0)
    line = curve_of(transfer, 0, 1)
    ends = [-3.0, 0.1, 0.3, 0.7, 0.9, 7.0]
    for first, last in pairwise(ends):
        inside = np.sort(rng.uniform(first, last, (50, 2)), axis=1)
        assert all(found(line, low, high)[0] == 0.0 for low, high in inside)
        is_step = last == 0.3
        assert all((found(line, low, last)[0] > 0) == is_step for low in [*inside[:, 0], first])


def test_smooth_colormaps_are_simplified() -> None:
    """Of 256 samples of smooth channels few remain, but a step and an opaque peak do."""
    values = np.sort(np.concatenate([np.linspace(0, 1, 256), [0.4, 0.4, 0.6, 0.601, 0.602]]))
    colors = 0.5 + 0.5 * np.sin(5 * values[:, None] + np.arange(3))
    extinctions = 0.5 + 0.4 * np.cos(4 * values)
    extinctions[np.searchsorted(values, 0.4) :] *= 0.5
    extinctions[values == 0.601] = 2.0
    transfer = TransferFunction(values, colors, extinctions, 1.0)
    line, points = curve_of(transfer, 0, 1), channels_of(transfer, 1.0)
    assert len(line.values) < 80
    rng = np.random.default_rng(3)
    for low, high in np.sort(rng.random((50, 2)) ** 3, axis=1):
        square, _, _ = between_scalars(np.array(low), np.array(high), values, points)
        assert abs(math.sqrt(found(line, low, high)[0]) - math.sqrt(square)) <= THINNED * points.max()


def ball(inside: float, outside: float, radius: float = 15.0, rise: float = math.inf) -> Volume:
    """Return a ball whose surface is as steep as it can be, or rises by `rise` from voxel to voxel."""
    z, y, x = np.ogrid[:40, :50, :45]
    depth = radius - np.sqrt((x - 20.3) ** 2 + (y - 24.0) ** 2 + (z - 19.0) ** 2)
    values = np.where(depth > 0, inside, outside)
    if rise < math.inf:
        values = np.clip((inside + outside) / 2 + rise * depth, min(inside, outside), max(inside, outside))
    return placed(values.astype(np.uint8), AFFINES["oblique"])


def over_fog(fog: float, peak: float, dense: float) -> TransferFunction:
    """Return a transfer function with a peak half-way between 0 and 1."""
    return transfer_of(
        (0, COLOR, fog), (0.4, COLOR, fog), (0.5, (0.9, 0.4, 0.1), peak), (0.6, COLOR, dense), (1, COLOR, dense)
    )


PEAK = transfer_of((100, COLOR, 0.0), (125, (0.9, 0.4, 0.1), 1.0), (150, COLOR, 0.0))
SHELL = transfer_of(
    (0, COLOR, 0.0), (60, COLOR, 0.0), (80, (0.9, 0.4, 0.1), 3.0), (100, COLOR, 0.05), (255, COLOR, 0.1)
)


@pytest.mark.parametrize(
    ("volume", "transfer"),
    [
        (ball(255, 0), PEAK),  # no voxel is visible
        (ball(1, 0), over_fog(0.002, 5.0, 0.002)),  # all voxels are, just
        (ball(1, 0), over_fog(0.002, 0.5, 0.002)),
        (ball(1, 0), over_fog(0.002, 0.1, 0.002)),
        (ball(1, 0), over_fog(0.0, 2.0, 0.1)),  # voxels show something else
        (ball(255, 0, rise=100), SHELL),
    ],
    ids=["peak", "opaque over fog", "clear over fog", "faint over fog", "over a body", "steep"],
)
def test_peaks_between_voxels_are_drawn_within_the_tolerance(volume: Volume, transfer: TransferFunction) -> None:
    """Root mean squares are below 0.2 of it, whether a shell is drawn or left out; seen: 0.01 to 0.13."""
    bricks, view = bricks_of(volume, transfer), view_of(volume, "perspective")
    truth = integrate(volume, transfer, view, step_voxels=1 / 16)
    assert truth[..., 3].max() > 0.1
    for tolerance in (1.0, 0.3, 0.1, 0.03, 0.01):
        error = picture(bricks, view, tolerance) - truth
        assert np.sqrt(np.mean(error**2)) < 0.2 * tolerance, tolerance
    assert np.sqrt(np.mean((picture(bricks, view, 0.0) - truth) ** 2)) < 1e-3


def box(first: int, end: int) -> Volume:
    """Return a cube between two planes of voxels, along each axis."""
    values = np.zeros((64, 64, 64), np.uint8)
    values[first:end, first:end, first:end] = 255
    return make_volume(values, np.eye(4), "box")


def blocks(width: int) -> Volume:
    """Return noise of blocks of voxels, as in an enlarged mask."""
    values = np.random.default_rng(0).integers(0, 256, (48 // width,) * 3, dtype=np.uint8)
    for axis in range(3):
        values = values.repeat(width, axis)
    return make_volume(values, np.eye(4), "blocks")


RAMP = transfer_of((0, (0.0, 0.2, 1.0), 0.0), (255, (1.0, 1.0, 1.0), 0.7))


@pytest.mark.parametrize(
    "volume",
    [box(16, 48), box(17, 49), box(18, 46), blocks(1), blocks(4)],
    ids=["on bricks", "beside bricks", "on nodes", "noise", "noise of 4 voxels"],
)
def test_edges_at_node_borders_are_drawn_within_the_tolerance(volume: Volume) -> None:
    """No node has an error there, and coarse cells would blur it all the same; the transfer function is linear, so that
    nothing shows between voxels either. Seen: 0.02 to 0.06 of the tolerance, and 0.00004 at 0."""
    bricks, view = bricks_of(volume, RAMP), view_of(volume, "perspective")
    truth = integrate(volume, RAMP, view, step_voxels=1 / 16)
    for tolerance in (0.3, 0.1, 0.03, 0.01):
        error = picture(bricks, view, tolerance) - truth
        assert np.sqrt(np.mean(error**2)) < 0.1 * tolerance, tolerance
    assert np.sqrt(np.mean((picture(bricks, view, 0.0) - truth) ** 2)) < 1e-4


def picture(bricks: Bricks, view: View, tolerance: float) -> Float64:
    """Draw all pixels of a cut."""
    batch = make_brick_batch(cut_bricks(bricks, tolerance), bricks, tolerance=tolerance, shading=None, voxel_px=1.0)
    batch = replace(batch, screen_sampling=EXACTLY)
    return rasterize_bricks_reference(batch, visible_bricks(batch, view), view)
