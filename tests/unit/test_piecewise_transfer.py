"""The transfer function by the scalars of texels: exact, and found at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from brick_reference import _classified
from brickwork import batch_of, bricks_of, level_cut, scalar_texels
from number_types import random_ranges
from texel_wall import drawn

from renderer.bricks import PADDED_BRICK_SIZE, Bricks
from renderer.kernels import PiecewiseTransfer
from renderer.transfer import GUIDE_SIZE, TransferFunction, make_piecewise_transfer
from renderer.volume import Float64, make_volume


def random_transfer(rng: np.random.Generator, low: float, high: float, num: int = 9) -> TransferFunction:
    """Return a function with some steps."""
    values = np.sort(low * (shares := rng.random(num)) + high * (1 - shares))
    values[2::4] = values[1::4][: len(values[2::4])]
    return TransferFunction(values, rng.random((num, 3)), rng.random(num) * 3, 1.0)


def classified(bricks: Bricks, u: Float64) -> Float64:
    """Return (r, g, b, extinction) of texels, [n, 4]."""
    channels = _classified(batch_of(level_cut(bricks, 0), bricks), u[:, None].astype(np.float64))
    tau = channels[:, 3:]
    colors = np.divide(channels[:, :3], tau, out=np.zeros((len(u), 3)), where=tau > 0)
    return np.hstack([colors, tau / bricks.volume.finest_spacing])


def test_texels_are_classified_as_voxels_are() -> None:
    """A texel has the channels of its voxel, on steps, too, and for all types."""
    for case, values in enumerate(random_ranges(12)):
        rng = np.random.default_rng(case)
        low, high = float(values.min()) / 2, float(values.max()) / 2
        transfer = random_transfer(rng, low, high)
        at = values.ravel()[:2]  # two of the voxels lie on steps
        if values.dtype.kind in "iu" and np.all(np.abs(at.astype(np.float64)) < 2.0**53):
            points = np.sort(np.concatenate([transfer.values[:-4], at, at]).astype(np.float64))
            transfer = TransferFunction(
                points, transfer.colors[: len(points)], transfer.extinctions[: len(points)], 1.0
            )
        bricks = bricks_of(make_volume(values.reshape(1, 1, -1), np.eye(4), "voxels"), transfer)
        texels = scalar_texels(bricks, np.zeros((1, 3), np.int32), lit=False)[
            0, 1, 1, 1 : 1 + min(values.size, PADDED_BRICK_SIZE - 2)
        ]
        got = classified(bricks, texels)
        colors, extinctions = transfer.classify(values.ravel()[: len(texels)])
        room = 1e-6 + 4 * 2.0**-24 * steepest(bricks.pieces)
        assert np.abs(got[:, 3] - extinctions).max() <= room, case
        seen = extinctions > 1e-3
        assert np.abs(got[:, :3] - colors)[seen].max(initial=0) <= room, case


def steepest(pieces: PiecewiseTransfer) -> float:
    """Return the largest change per unit of u in segments that are wider than the rounding of texels."""
    wide = np.diff(pieces.rows[:, 0][:-1], prepend=-1.0) > 1e-5
    return float(np.abs(pieces.rows[:-1, 8:][wide]).max(initial=0.0))


def at(pieces: PiecewiseTransfer, u: Float64) -> Float64:
    """Return the extinctions at u."""
    k = np.searchsorted(pieces.rows[:, 0], u.astype(np.float32), side="right")
    return np.asarray(pieces.rows[k, 2] + (u - pieces.rows[k, 1]) * pieces.rows[k, 3].astype(np.float64))


def test_the_guide_starts_at_or_before_the_segment() -> None:
    """From 0 on, it starts no further away than its part of the range has segments."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        pieces = make_piecewise_transfer(random_transfer(rng, -3.0, 5.0, 40).curve(), 0.0, 2.0)
        u = np.concatenate([rng.uniform(0, 1, 5000), pieces.rows[:, 0][:-1]]).astype(np.float32)
        u = u[(u >= 0) & (u < 1)]
        bucket = (u * np.float32(GUIDE_SIZE)).astype(int)
        piece, begin = np.searchsorted(pieces.rows[:, 0], u, side="right"), pieces.guide[bucket]
        assert np.all(begin <= piece)
        ends = pieces.rows[:-1, 0]
        inside = np.bincount((ends[(ends >= 0) & (ends < 1)] * GUIDE_SIZE).astype(int))
        inside = np.append(inside, np.zeros(GUIDE_SIZE, int))
        assert np.all(piece - begin <= inside[bucket])


@pytest.mark.parametrize("last", [1e-322, 1e-300, 1.0, 1e300])
def test_segments_are_finite(last: float) -> None:
    """This holds over scalars too small for their inverse, or too large for their difference."""
    values = np.array([-last, -last / 2, 0.0, 0.0, last / 3, last])
    transfer = TransferFunction(values, np.ones((6, 3)), np.array([0, 1.0, 2, 0, 3, 0]), 1.0)
    pieces = make_piecewise_transfer(transfer.curve(), -last, last)
    assert np.isfinite(pieces.rows[:-1]).all() and np.isfinite(pieces.rows[-1, 1:]).all()
    assert pieces.rows[:, 0][-1] == np.inf
    np.testing.assert_allclose(at(pieces, np.array([0.25, 0.5, 2 / 3])), [1, 0, 3], atol=0.2)


def extinctions_at(pieces: PiecewiseTransfer, scalars: Any) -> Float64:
    """Return the extinctions of scalars by what a ray loses in a thousandth of a spacing."""
    return -1000 * np.log1p(-drawn(scalars, pieces, scale=1e-3)[:, 3].astype(np.float64))


def test_lanes_find_the_segment() -> None:
    """Few segments are looked up in registers, and many in memory; the results are the same bits."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        transfer = random_transfer(rng, -3.0, 5.0, 1 + seed)
        pieces = make_piecewise_transfer(transfer.curve(), 0.0, 2.0)
        u = np.concatenate([rng.uniform(-1, 2, 512 - len(pieces.rows)), pieces.rows[:-1, 0]]).astype(np.float32)
        more = np.append(pieces.rows, np.repeat(pieces.rows[-1:], 20, axis=0), axis=0)  # none of which is reached
        more[len(pieces.rows) - 1 : -1, 0] = 1e30
        assert drawn(u, pieces).tobytes() == drawn(u, pieces._replace(rows=more)).tobytes()
        is_inside = u >= 0
        got, expected = extinctions_at(pieces, u[is_inside]), at(pieces, u[is_inside])
        np.testing.assert_allclose(got, expected, atol=1e-6 * (1 + steepest(pieces)), rtol=1e-6)


def test_nothing_is_visible_below_the_lowest_visible_scalar() -> None:
    for seed in range(200):
        rng = np.random.default_rng(seed)
        transfer = random_transfer(rng, -3.0, 5.0, 8)
        extinctions = transfer.extinctions * (rng.random(8) < rng.random())
        transfer = TransferFunction(transfer.values, transfer.colors, extinctions, 1.0)
        pieces = make_piecewise_transfer(transfer.curve(), 0.0, 2.0)
        scalars, lowest = np.sort(rng.uniform(-1, 2, 64)).astype(np.float32), pieces.lowest_visible
        is_visible = drawn(scalars, pieces._replace(lowest_visible=-np.inf))[:, 3] > 0
        assert not is_visible[scalars < lowest].any()
        num_invisible = int(np.argmax(is_visible)) if is_visible.any() else len(scalars)
        assert np.count_nonzero(scalars < lowest) == num_invisible or lowest == -np.inf
