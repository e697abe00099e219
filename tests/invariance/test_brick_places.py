"""An image of bricks depends neither on what was drawn before, which decides the slots of bricks in the atlas, nor on
whether texels are voxels or scalars."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from brickwork import (
    AFFINES,
    GLOSSY,
    alone,
    batch_of,
    bricks_of,
    hills,
    level_cut,
    ordered,
    placed,
    random_cut,
    transfer_of,
    view_of,
)

from renderer.bricks import BrickBatch, ScreenSampling, make_brick_batch, texel_rules, voxel_texels
from renderer.draw import BrickRasterizer
from renderer.scene import MAX_FIELD_OF_VIEW, MAX_SIDE, ShadingSpec
from renderer.system import MemoryShare
from renderer.view import View
from renderer.volume import Array


def subject(shading: ShadingSpec | None) -> tuple[list[BrickBatch], View, View]:
    """Return batches and two views in which any other sample position gives another colour.

    The transfer function is steep, and no step meets a voxel.
    """
    volume = placed(hills((50, 60, 70), 9.0), AFFINES["oblique"])
    transfer = transfer_of((0, (0.9, 0.2, 0.1), 0.0), (0.5, (0.1, 0.5, 1.0), 0.3), (0.51, (1.0, 1.0, 1.0), 0.0))
    bricks = bricks_of(volume, transfer, shading)
    cuts = level_cut(bricks, 0), random_cut(bricks, 3), level_cut(bricks, 1)
    batches = [batch_of(cut, bricks, step=0.3, shading=shading) for cut in cuts]
    batches = [replace(batch, bricks=batches[0].bricks) for batch in batches]
    return batches, view_of(volume, "perspective", (40, 30)), view_of(volume, "inside", (40, 30), azimuth=200.0)


@pytest.mark.parametrize("shading", [None, ShadingSpec()], ids=["plain", "lit"])
def test_what_was_drawn_before_changes_nothing(shading: ShadingSpec | None) -> None:
    """Nor does the memory for bricks: for all, for a few, for one."""
    batches, view, other = subject(shading)

    def draw(rasterizer: BrickRasterizer, batch: BrickBatch) -> bytes:
        return rasterizer.rasterize([batch], [ordered(batch.cut, view)], view).tobytes()

    histories: list[Callable[[BrickRasterizer, BrickBatch], Any]] = [
        draw,
        lambda rasterizer, batch: rasterizer.upload([batch], [ordered(batch.cut, view)], view),
        lambda rasterizer, batch: [rasterizer.upload([batch], [ordered(batch.cut, other)], other) for batch in batches],
        lambda rasterizer, batch: rasterizer.rasterize([batch], [ordered(batch.cut, other)[::3]], other),
        lambda rasterizer, batch: [draw(rasterizer, batch) for batch in batches],
        lambda rasterizer, batch: rasterizer.rasterize(
            [batch], [np.flatnonzero(np.arange(len(batch)) % 5 == 2).astype(np.uint32)], other
        ),
    ]
    for batch in batches:
        with BrickRasterizer() as rasterizer:
            first = draw(rasterizer, batch)
        for num_bytes in (1 << 30, 8 << 20, 1):
            for history in histories:
                with BrickRasterizer(memory=MemoryShare(num_bytes)) as rasterizer:
                    history(rasterizer, batch)
                    assert draw(rasterizer, batch) == first


@pytest.mark.parametrize("shading", [None, ShadingSpec(), GLOSSY], ids=["plain", "lit", "glossy"])
@pytest.mark.parametrize("affine", ["straight", "anisotropic", "oblique"])
@pytest.mark.parametrize(("dtype", "low"), [("u1", 20), ("i1", -100), ("u2", 3000), ("i2", -1000)])
def test_texels_that_are_voxels_draw_the_same_bytes(
    dtype: str, low: int, affine: str, shading: ShadingSpec | None
) -> None:
    """Also at the volume's border, where differences are one-sided, and along axes of one and of two voxels."""
    points = (low + 30.3, (0.9, 0.2, 0.1), 0.0), (low + 90, (0.1, 0.5, 1.0), 0.3), (low + 130.5, (1.0, 1.0, 1.0), 0.1)
    for shape in ((34, 18, 16), (1, 2, 40)):
        volume = placed((low + 140 * hills(shape, 9.0)).astype(dtype), AFFINES[affine])
        bricks = bricks_of(volume, transfer_of(*points), shading)
        batch = batch_of(level_cut(bricks, 0), bricks, step=0.3, shading=shading)
        assert batch.keeps_voxels and batch.bricks.layers[0].voxel_texels is not None
        pictures = []
        for each in (batch, replace(batch, samples_per_voxel=np.inf)):
            for view in (view_of(volume, "perspective", (40, 30)), view_of(volume, "inside", (40, 30), azimuth=200.0)):
                with BrickRasterizer() as rasterizer:
                    pictures.append(rasterizer.rasterize([each], [ordered(each.cut, view)], view))
                    (cache,) = rasterizer.caches.values()
                    assert cache.keeps_voxels == each.keeps_voxels
        assert pictures[0].max() > 0.1
        assert [picture.tobytes() for picture in pictures[:2]] == [picture.tobytes() for picture in pictures[2:]]


def batch_of_bytes(shading: ShadingSpec, voxel_px: float) -> BrickBatch:
    """Return the bricks of level 0 of a volume of 8 bits, whose voxels are `voxel_px` wide on the picture."""
    volume = placed((200 * hills((34, 18, 16), 9.0)).astype(np.uint8))
    bricks = bricks_of(volume, transfer_of((0, (0.9, 0.2, 0.1), 0.0), (200, (0.1, 0.5, 1.0), 0.3)), shading)
    return make_brick_batch(level_cut(bricks, 0), alone(bricks, shading), tolerance=0.1, voxel_px=voxel_px)


@pytest.mark.parametrize(("voxel_px", "num_bytes"), [(0.2, 20**3), (5.0, 4 * 4 * 18**3)])
def test_texels_are_voxels_where_few_samples_are_taken(voxel_px: float, num_bytes: int) -> None:
    """Such bricks take less memory; with more samples, gradients are made once for each voxel."""
    batch = batch_of_bytes(ShadingSpec(), voxel_px)
    view = view_of(batch.cut.volume, "perspective", (40, 30))
    with BrickRasterizer() as rasterizer:
        rasterizer.rasterize([batch], [ordered(batch.cut, view)], view)
        memory = rasterizer.brick_memory
        num_means = sum(np.count_nonzero(level.is_visible) for level in batch.bricks.levels[1:])
        assert memory is not None
        assert memory.needed == len(batch) * num_bytes + num_means * 4 * 4 * 18**3


def test_texels_without_gradients_are_refused_for_light() -> None:
    batch = batch_of_bytes(ShadingSpec(), 0.2)
    view = view_of(batch.cut.volume, "perspective", (40, 30))
    with BrickRasterizer() as rasterizer:
        order = ordered(batch.cut, view)
        rasterizer.upload([batch], [order], view)
        (cache,) = rasterizer.caches.values()
        layer = batch.bricks.layers[0]
        cache._rules[:] = [texel_rules(layer.bricks, lit=False, kept=layer.voxel_texels)]
        cache._brick_view = None
        with pytest.raises(IndexError, match="draw_tiles"):
            rasterizer.rasterize([batch], [order], view)


@pytest.mark.parametrize("voxels", [hills((8, 8, 8), 5.0), (100 * hills((8, 8, 8), 5.0)).astype(np.float16)])
def test_numbers_that_are_no_integers_are_no_texels(voxels: Array) -> None:
    bricks = bricks_of(placed(voxels), transfer_of((0, (0.9, 0.2, 0.1), 0.0), (1, (0.1, 0.5, 1.0), 0.3)))
    assert voxel_texels(bricks) is None


def test_bricks_are_uploaded_once() -> None:
    batches, view, _ = subject(None)
    with BrickRasterizer() as rasterizer:
        for batch in batches:
            order = ordered(batch.cut, view)
            assert rasterizer.upload([batch], [order], view)
            assert not rasterizer.upload([batch], [order], view)
        for batch in batches:  # there is room for all
            assert not rasterizer.upload([batch], [ordered(batch.cut, view)], view)
    with BrickRasterizer() as rasterizer:
        rasterizer.rasterize([batches[0]], [ordered(batches[0].cut, view)], view)
        assert not rasterizer.upload([batches[0]], [ordered(batches[0].cut, view)], view)


def test_more_bricks_than_slots_are_not_uploaded_ahead() -> None:
    """They are uploaded, and evicted, while they are drawn."""
    batches, view, _ = subject(ShadingSpec())
    with BrickRasterizer(memory=MemoryShare(1 << 10)) as rasterizer:
        assert not rasterizer.upload([batches[0]], [ordered(batches[0].cut, view)], view)


@pytest.mark.parametrize("shading", [None, ShadingSpec(), GLOSSY], ids=["plain", "lit", "glossy"])
def test_pictures_do_not_depend_on_the_number_of_threads(monkeypatch, shading: ShadingSpec | None) -> None:
    """Neither bricks nor the interpolation between the pixels of subsampled grids depend on it."""
    monkeypatch.setattr("renderer.kernels.threads.MIN_PIXELS_PER_THREAD", 1)
    batches, view, _ = subject(shading)
    batches.append(replace(batches[0], screen_sampling=ScreenSampling((8, 4, 2), 0.02, 0.0)))
    pictures = []
    for num_threads in (1, 2, 3):
        with BrickRasterizer(num_threads=num_threads) as rasterizer:
            pictures.append(
                [rasterizer.rasterize([batch], [ordered(batch.cut, view)], view).tobytes() for batch in batches]
            )
    assert pictures[0] == pictures[1] == pictures[2]


@pytest.mark.parametrize("shading", [None, ShadingSpec()], ids=["plain", "lit"])
def test_samples_stay_in_their_brick(shading: ShadingSpec | None) -> None:
    """No sample reads the rest of the atlas, which is filled with NaN.

    In the widest image that a scene may have, float32 moves the outer rays by whole voxels.
    """
    volume = placed(hills((16, 16, 80), 9.0))
    bricks = bricks_of(volume, transfer_of((0, (0.9, 0.2, 0.1), 0.1), (1, (0.1, 0.5, 1.0), 0.3)), shading)
    batch, order = batch_of(level_cut(bricks, 0), bricks, shading=shading), np.zeros(1, np.uint32)
    eye, scale_px = np.array([3.0, 4.0, 5.0]), 0.5 / math.tan(math.radians(MAX_FIELD_OF_VIEW / 2))
    with BrickRasterizer() as rasterizer:
        for azimuth in (20.0, 100.0, 200.0, 300.0):
            view = replace(view_of(volume, "inside", (MAX_SIDE, 1), azimuth), target=eye, scale_px=scale_px)
            expected = rasterizer.rasterize([batch], [order], view)
            atlas = rasterizer.caches[id(batch.bricks)].scalars[0]
            free = np.flatnonzero(atlas._key_from_slot < 0)
            assert len(free) > 0
            num = atlas.brick_floats
            atlas.texels[free[:, None] * num + np.arange(num)] = np.nan
            assert expected[..., 3].max() > 0.5
            assert rasterizer.rasterize([batch], [order], view).tobytes() == expected.tobytes()
