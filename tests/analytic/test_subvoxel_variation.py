"""Pictures of what shows between voxels meet the tolerance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from brick_reference import picture_at
from brickwork import AFFINES, bricks_of, placed, transfer_of, view_of
from dense_bricks import channels_of
from ray_integrals import integrate

from renderer.bricks import make_channel_curve
from renderer.transfer import TransferFunction
from renderer.volume import Volume, make_volume

# By which share of its largest value a curve may move where it is simplified.
SIMPLIFICATION_TOLERANCE = 2.0**-12

COLOR = (0.2, 0.7, 1.0)


def test_smooth_colormaps_are_simplified() -> None:
    """Of 256 samples of smooth channels few remain, but a step and an opaque peak do."""
    values = np.sort(np.concatenate([np.linspace(0, 1, 256), [0.4, 0.4, 0.6, 0.601, 0.602]]))
    colors = 0.5 + 0.5 * np.sin(5 * values[:, None] + np.arange(3))
    extinctions = 0.5 + 0.4 * np.cos(4 * values)
    extinctions[np.searchsorted(values, 0.4) :] *= 0.5
    extinctions[values == 0.601] = 2.0
    transfer = TransferFunction(values, colors, extinctions, 1.0)
    line, points = make_channel_curve(transfer, 1.0, False, 1.0, (0.0, 1.0)), channels_of(transfer, 1.0)
    assert len(line.values) < 80
    for channel, exact in enumerate(points.T):
        thinned = np.interp(values, line.values, line.rows[1:, 2 + channel])
        assert np.abs(thinned - exact).max() <= 1.001 * SIMPLIFICATION_TOLERANCE * points.max()


def test_what_only_many_labels_have_is_not_simplified() -> None:
    """It would take a minute for 65,535 steps, of which none could be left out."""
    num = 2**13 + 1
    transfer = TransferFunction(np.arange(num) / 1.0, np.full((num, 3), 0.5), np.full(num, 2.0), 1.0)
    assert len(make_channel_curve(transfer, 1.0, False, 1.0, (0.0, 1.0)).values) == num


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
        (ball(1, 0), over_fog(0.002, 0.1, 0.002)),
        (ball(1, 0), over_fog(0.0, 2.0, 0.1)),  # voxels show something else
        (ball(255, 0, rise=100), SHELL),
    ],
    ids=["peak", "opaque over fog", "faint over fog", "over a body", "steep"],
)
def test_peaks_between_voxels_are_drawn_within_the_tolerance(volume: Volume, transfer: TransferFunction) -> None:
    """Root mean squares are below 0.2 of it, whether a shell is drawn or left out; seen: 0.01 to 0.13."""
    bricks, view = bricks_of(volume, transfer), view_of(volume, "perspective")
    truth = integrate(volume, transfer, view, step_voxels=1 / 4)
    assert truth[..., 3].max() > 0.1
    for tolerance in (1.0, 0.3, 0.1, 0.03, 0.01):
        error = picture_at(bricks, view, tolerance) - truth
        assert np.sqrt(np.mean(error**2)) < 0.2 * tolerance, tolerance
    assert np.sqrt(np.mean((picture_at(bricks, view, 0.0) - truth) ** 2)) < 1e-3


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
    "volume", [box(16, 48), box(18, 46), blocks(4)], ids=["on bricks", "on nodes", "noise of 4 voxels"]
)
def test_edges_at_node_borders_are_drawn_within_the_tolerance(volume: Volume) -> None:
    """No node has an error there, and coarse cells would blur it all the same; the transfer function is linear, so that
    nothing shows between voxels either. Seen: 0.02 to 0.06 of the tolerance, and 0.00004 at 0."""
    bricks, view = bricks_of(volume, RAMP), view_of(volume, "perspective")
    truth = integrate(volume, RAMP, view, step_voxels=1 / 4)
    for tolerance in (0.3, 0.1, 0.03, 0.01):
        error = picture_at(bricks, view, tolerance) - truth
        assert np.sqrt(np.mean(error**2)) < 0.1 * tolerance, tolerance
    assert np.sqrt(np.mean((picture_at(bricks, view, 0.0) - truth) ** 2)) < 1e-4
