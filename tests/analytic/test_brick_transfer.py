"""The transfer function in pictures of bricks, against closed forms."""

from __future__ import annotations

import numpy as np
from brickwork import batch_of, bricks_of, level_cut, ordered

from renderer.bricks import Bricks
from renderer.draw import BrickRasterizer
from renderer.transfer import TransferFunction
from renderer.view import View
from renderer.volume import Float64, make_volume


def seen_along_z(brick_rasterizer: BrickRasterizer, bricks: Bricks, step: float) -> Float64:
    """Draw one pixel for each voxel of a slice, [y, x, 4]."""
    num_x, num_y, _ = bricks.volume.shape_xyz
    view = View(np.diag([1.0, -1.0, -1.0]), bricks.volume.centre, 100.0, "orthographic", 1.0, (num_x, num_y))
    batch = batch_of(level_cut(bricks, 0), bricks, step=step)
    return brick_rasterizer.rasterize([batch], [ordered(batch.cut, view)], view).astype(np.float64)


def test_labels_keep_their_own_color(brick_rasterizer: BrickRasterizer) -> None:
    """Labels are red and blue in turns, each from its number to the next."""
    num = 24
    labels = np.broadcast_to(np.repeat(np.arange(num, dtype=np.uint8), 4), (3, 5, 4 * num))
    values = np.repeat(np.arange(num + 1.0), 2)[1:-1]
    is_odd = (np.arange(num) % 2 == 1)[:, None]
    colors = np.repeat(np.where(is_odd, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), 2, axis=0)
    bricks = bricks_of(
        make_volume(labels.copy(), np.eye(4), "labels"), TransferFunction(values, colors, np.full(2 * num, 0.7), 1.0)
    )
    image = seen_along_z(brick_rasterizer, bricks, 0.5)[2, 2::4]
    alpha = 1 - np.exp(-0.7 * 3)
    np.testing.assert_allclose(image[:, 0], alpha * (np.arange(num) % 2), atol=1e-6)
    np.testing.assert_allclose(image[:, 2], alpha * (np.arange(num) % 2 == 0), atol=1e-6)


def test_a_narrow_shell_in_a_wide_range(brick_rasterizer: BrickRasterizer) -> None:
    """A tent from 290 to 310 on a ramp up to a million, through which the field goes by 2 a voxel: 10 voxels of half
    its height. Columns beside the one voxel of a million are left out."""
    z = np.arange(21.0)
    values = np.broadcast_to((280 + 2 * z)[:, None, None], (21, 6, 7)).copy()
    values[0, 0, 0] = 1e6
    knots, height = np.array([0, 290, 300, 310, 1e6]), 0.15
    transfer = TransferFunction(knots, np.ones((5, 3)), np.array([0, 0, height, 0, 0.1]), 1.0)
    bricks = bricks_of(make_volume(values.astype(np.float32), np.eye(4), "shell"), transfer)
    alphas = seen_along_z(brick_rasterizer, bricks, 1 / 16)[2:, 2:, 3]
    np.testing.assert_allclose(alphas, 1 - np.exp(-height * 10 / 2), atol=2e-3)
