"""What the reference rasteriser of bricks spares, and one ray by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from brick_reference import rasterize_bricks_reference
from brickwork import AFFINES, EXACTLY, batch_of, bricks_of, hills, level_cut, ordered, placed, transfer_of, view_of
from scipy.ndimage import map_coordinates, zoom

from renderer.bricks import BrickBatch, ScreenSampling
from renderer.view import View
from renderer.volume import Float64

SIZE = (21, 14)


def subject(screen_sampling: ScreenSampling = EXACTLY, camera: str = "perspective") -> tuple[BrickBatch, View]:
    """A volume that fills a part of the picture, or all of it from inside."""
    volume = placed(hills((20, 26, 24), 12.0), AFFINES["oblique"])
    bricks = bricks_of(volume, transfer_of((0, (0.9, 0.2, 0.1), 0.0), (1, (0.1, 0.5, 1.0), 0.4)))
    return batch_of(level_cut(bricks, 0), bricks, screen_sampling=screen_sampling), view_of(volume, camera, SIZE)


def draw(screen_sampling: ScreenSampling = EXACTLY, camera: str = "perspective") -> Float64:
    batch, view = subject(screen_sampling, camera)
    return rasterize_bricks_reference(batch, ordered(batch.cut, view), view)


def test_one_ray_by_hand() -> None:
    """Along z through one brick, from the highest voxel to the lowest: at a phase of 0 there are 9 parts of 2/3 of a
    voxel, since 10 * 0.925 + 0.5 is below 10."""
    values = np.random.default_rng(1).random((6, 3, 3)).astype(np.float32)
    volume = placed(values)
    bricks = bricks_of(volume, transfer_of((0, (1.0, 0.5, 0.0), 0.0), (1, (1.0, 0.5, 0.0), 1.0)))
    batch = batch_of(level_cut(bricks, 0), bricks, step=0.6)
    view = View(np.eye(3), np.array([0.8, 1.3, 0.0]), 50.0, "orthographic", 1.0, (1, 1))
    z = 5.5 - 2 / 3 * (np.arange(9) + 0.5)
    first, last = bricks.scalar_range
    u = np.clip(
        map_coordinates(values.astype(float), [z, np.full(9, 1.3), np.full(9, 0.8)], order=1, mode="nearest"),
        first,
        last,
    )
    alpha = -np.expm1(-2 / 3 * u)
    behind = np.cumprod(np.append(1.0, 1 - alpha))[:-1]
    expected = np.sum(alpha * behind) * np.array([1.0, 0.5, 0.0, 1.0])
    np.testing.assert_allclose(
        rasterize_bricks_reference(batch, np.array([0], np.uint32), view)[0, 0], expected, rtol=1e-6
    )


@pytest.mark.parametrize("strides", [(4, 1), (8, 4, 2, 1), (16, 1)])
def test_blocks_that_differ_are_drawn(strides: tuple[int, ...]) -> None:
    """All of them, at a spread of 0, for no four rays are alike, nor on one line."""
    np.testing.assert_allclose(draw(ScreenSampling(strides, 0.0, 0.0), "inside"), draw(camera="inside"), atol=1e-15)


def test_what_is_alike_is_interpolated() -> None:
    """Where everything is alike the last lattice does not matter."""
    whole = draw()
    for strides in ((2,), (2, 1), (4, 2, 1), (4,)):
        image = draw(ScreenSampling(strides, 2.0, 0.0))
        stride = strides[0]
        np.testing.assert_array_equal(image[::stride, ::stride], whole[::stride, ::stride])
        # Up to the last node inside.
        inner = image[: (SIZE[1] - 1) // stride * stride + 1, : (SIZE[0] - 1) // stride * stride + 1]
        nodes = whole[::stride, ::stride]
        across = (inner.shape[0] / nodes.shape[0], inner.shape[1] / nodes.shape[1], 1)
        np.testing.assert_allclose(inner, zoom(nodes, across, order=1), atol=1e-12)


def test_some_are_drawn_and_some_are_not() -> None:
    """The error stays in the order of the spread, and fewer blocks are alike the smaller it is."""
    whole = draw()
    num_wrong = [
        np.count_nonzero(np.any(np.abs(draw(ScreenSampling((2, 1), spread, 0.0)) - whole) > 1e-12, axis=2))
        for spread in (0.02, 0.1, 0.4)
    ]
    assert 0 < num_wrong[0] < num_wrong[1] < num_wrong[2] < whole[..., 3].size


def test_lattices_divide_each_other() -> None:
    with pytest.raises(AssertionError, match=r"\(6, 4\)"):
        draw(ScreenSampling((6, 4), 0.1, 0.0))


@pytest.mark.parametrize("least", [0.5, 0.1])
def test_nothing_is_drawn_behind_what_is_opaque(least: float) -> None:
    whole, image = draw(), draw(ScreenSampling((1,), 0.0, least))
    stopped = image[..., 3] < whole[..., 3]
    assert stopped.any()
    assert np.all(image[stopped][:, 3] > 1 - least)
    assert np.abs(image - whole).max() <= least


def test_no_bricks_leave_nothing() -> None:
    batch, view = subject()
    image = rasterize_bricks_reference(batch, np.empty(0, np.uint32), view)
    assert image.shape == (SIZE[1], SIZE[0], 4)
    assert not image.any()
    assert not rasterize_bricks_reference(
        replace(batch, screen_sampling=ScreenSampling((4, 2), 0.0, 0.0)), np.empty(0, np.uint32), view
    ).any()
