"""The parts that draw bricks on the CPU: arithmetic, threads, and the atlas in memory."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
import pytest
from brickwork import AFFINES, batch_of, bricks_of, hills, level_cut, ordered, placed, transfer_of, view_of
from texel_wall import drawn

from renderer.bricks import PADDED_BRICK_SIZE
from renderer.draw import Atlas, BrickRasterizer, RayGrid, make_grid, plan_bands, share_memory, share_out
from renderer.kernels import Light, Shading
from renderer.system import MemoryShare
from renderer.transfer import NO_LIGHT_GRID

BRICK_FLOATS = PADDED_BRICK_SIZE**3
BRICK_BYTES = 4 * BRICK_FLOATS
GLASS = transfer_of((0, (0.9, 0.2, 0.1), 0.0), (1, (0.1, 0.5, 1.0), 0.3))


def test_opacities_keep_their_digits() -> None:
    depths = np.concatenate([np.logspace(-37, 2, 20_000), np.linspace(0.4, 0.6, 2014), [0]]).astype(np.float32)
    got, expected = drawn(depths)[:, 3], -np.expm1(-depths.astype(np.float64))
    assert np.abs(got[:-1] / expected[:-1] - 1).max() < 3e-7
    assert got[-1] == 0.0
    assert got.max() <= 1.0


@pytest.mark.parametrize("exponent", [1e-3, 0.5, 1.0, 32.0, 999.0])
def test_powers_keep_their_digits(exponent: float) -> None:
    """Highlights are powers of the cosine between the normal and the view, which float32 rounds a little."""
    cosines = np.concatenate([np.logspace(-30, 0, 20_000), np.linspace(0.5, 1, 4094), [1]]).astype(np.float32)
    gradients = np.column_stack([np.sqrt(1 - cosines.astype(np.float64) ** 2), 0 * cosines, cosines]).astype(np.float32)
    light = Light(
        shading=Shading(0.0, 0.0, specular=1.0, shininess=exponent, silhouette=0.0, two_sided=False),
        grid=NO_LIGHT_GRID,
        is_camera=True,
        toward=np.zeros(3),
        world_from_index=np.eye(3),
        factors=np.empty((0, 3), np.float32),
        first_cell=np.zeros(3),
        change_per_length=1.0,
    )
    got = drawn(np.full(len(cosines), 50.0), light=light, gradients=gradients)[:, 0]
    wide = gradients.astype(np.float64)
    expected = (wide[:, 2] / np.linalg.norm(wide, axis=1)) ** np.float32(exponent)
    is_seen = expected > 1e-4
    assert np.abs(got[is_seen] / expected[is_seen] - 1).max() < 1e-5 + 2e-7 * exponent
    assert np.abs(got - expected)[~is_seen].max(initial=0.0) < 1e-8
    assert got[-1] == 1.0


def writer(keys: Any) -> Any:
    """Return a function that writes texels that tell of their key."""

    def write(chosen: Any, slots: Any, texels: Any) -> None:
        texels[slots] = np.asarray(keys, np.float32)[chosen, None]

    return write


def content(atlas: Atlas, keys: Any) -> list[float]:
    with atlas.placed(np.asarray(keys)) as placed:
        return [float(atlas.texels[first]) for first in placed.offsets]


def upload(atlas: Atlas, keys: Any, next_use: Any = None) -> None:
    """Make the missing ones of some bricks."""
    with atlas.placed(keys, next_use) as placed:
        atlas.fill(placed, writer(keys))


def test_bricks_stay_where_they_are_when_there_are_more() -> None:
    """A copy would take memory that nobody reckons with."""
    atlas = Atlas(BRICK_FLOATS, 1000, 1000 * BRICK_BYTES)
    atlas.reserve()
    upload(atlas, np.arange(10))
    texels = atlas.texels
    atlas.reserve()
    assert atlas.texels is texels
    assert atlas.num_missing(np.arange(10)) == 0
    assert content(atlas, np.arange(10)) == list(range(10))
    assert len(atlas.texels) - 1000 * PADDED_BRICK_SIZE**3 in range(8)  # no more than there are bricks
    atlas.release()
    assert atlas.num_missing(np.arange(10)) == 10
    assert len(atlas.texels) == 0


def test_bricks_that_were_drawn_longest_ago_go_first() -> None:
    atlas = Atlas(BRICK_FLOATS, 1000, 4 * BRICK_BYTES)
    assert atlas.max_slots == 4
    assert Atlas(BRICK_FLOATS, 3, 4 * BRICK_BYTES).max_slots == 3
    assert Atlas(BRICK_FLOATS, 3, 0).max_slots == 1  # room for less than a brick
    atlas.reserve()
    for keys in map(np.array, ([1, 2], [3, 4], [1], [7, 8])):
        upload(atlas, keys)
    assert [atlas.num_missing(np.array([key])) for key in (1, 2, 3, 4, 7, 8)] == [0, 1, 1, 0, 0, 0]
    assert content(atlas, [8, 1, 7]) == [8, 1, 7]


@pytest.mark.parametrize("num_slots", [3, 6, 9, 12])
def test_a_scan_keeps_the_bricks_that_fit(num_slots: int) -> None:
    """Of pictures of 4 bands of 3 bricks, few are made again: as few as Belady's order makes of a scan in a circle.

    Each band must have slots while it is drawn. Of N bands, of which C have room, then (N - C) / (N - 1) are made anew:
    all bands between two uses of one but those that stay. The order by last uses would make all of them.
    """
    atlas, made, keys = Atlas(BRICK_FLOATS, 1000, num_slots * BRICK_BYTES), list[int](), np.arange(12)
    atlas.reserve()
    for _ in range(1 + 3 * 4):
        atlas.plan(keys, keys // 3)
        made.append(0)
        for band in keys.reshape(4, 3):
            made[-1] += atlas.num_missing(band)
            upload(atlas, band, 4 + band // 3)
    assert made[0] == 12
    assert sum(made[1:]) == 12 * 12 * (4 - num_slots // 3) // 3


def test_bands_that_share_bricks_keep_them() -> None:
    """Bricks of one band that the next one meets again stay, and of others those that the next picture needs first."""
    starts, numbers = np.array([0, 2, 4, 6, 8]), np.array([0, 1, 1, 2, 2, 3, 3, 0])
    bands, first_use = plan_bands(starts, numbers, 5, lambda met, times: times == 1 and len(met) <= 2)
    assert [band.tiles.tolist() for band in bands] == [[0], [1], [2], [3]]
    assert [band.met.tolist() for band in bands] == [[0, 1], [1, 2], [2, 3], [0, 3]]
    assert [band.next_use.tolist() for band in bands] == [[3, 1], [4, 2], [5, 3], [4, 6]]
    assert first_use.tolist() == [0, 0, 1, 2, -1]
    (whole,), _ = plan_bands(starts, numbers, 5, lambda met, times: len(met) * times <= 4)
    assert (whole.tiles.tolist(), whole.met.tolist(), whole.next_use.tolist()) == ([0, 1, 2, 3], [0, 1, 2, 3], [1] * 4)


def test_only_tiles_with_rays_get_bricks() -> None:
    """Of a picture of 2 x 3 tiles, one pixel of a single tile has rays; bricks elsewhere are not drawn."""
    places = np.full((64, 96), -1, np.int32)
    places[40, 70] = 0
    rectangles = np.array([[0.0, 0, 96, 64], [0, 0, 30, 30], [65, 33, 80, 50], [10, 10, 10, 10]])
    grid = make_grid(rectangles, RayGrid(np.zeros((4, 4), np.float32), (64, 96), places, rays_across=2))
    (tile,) = np.flatnonzero(np.diff(grid.starts))
    assert grid.numbers.tolist() == [0, 2]
    assert tile == 80 // grid.side * (2 * 96 // grid.side) + 140 // grid.side
    assert grid.rectangles[3].tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize(
    ("needs", "total", "shares"),
    [
        ([5, 20, 10], 100, [5, 20, 10]),
        ([5, 20, 10], 30, [5, 15, 10]),
        ([50, 20, 10], 30, [10, 10, 10]),
        ([50, 0], 30, [30, 0]),
        ([50, 60], 0, [0, 0]),
    ],
)
def test_memory_goes_to_small_needs_first(needs: list[int], total: int, shares: list[int]) -> None:
    assert share_out(needs, total) == shares


@pytest.mark.parametrize(
    ("limit", "shares"),
    [
        (200, {1: [70, 30], 2: [50]}),  # enough for all that is visible
        (100, {1: [20, 30], 2: [50]}),  # what is drawn first, and of the rest as much as there is
        (60, {1: [0, 20], 2: [40]}),
        (30, {1: [0, 15], 2: [15]}),
    ],
)
def test_memory_is_for_what_is_drawn_first(limit: int, shares: dict[int, list[int]]) -> None:
    """A cut of larger cells draws no voxels, which are most of what is visible."""
    assert share_memory({1: [0, 20], 2: [40]}, {1: [70, 30], 2: [50]}, limit) == shares


def test_threads_end_with_the_rasterizer() -> None:
    before = threading.active_count()
    bricks = bricks_of(placed(hills((20, 30, 40), 9.0), AFFINES["straight"]), GLASS)
    view = view_of(bricks.volume, "perspective", (60, 50))
    batch = batch_of(level_cut(bricks, 0), bricks)
    with BrickRasterizer(num_threads=3) as rasterizer:
        rasterizer.rasterize([batch], [ordered(batch.cut, view)], view)
        assert threading.active_count() > before
    assert threading.active_count() == before


@pytest.mark.parametrize("num_threads", [1, 3])
@pytest.mark.parametrize("share", [0.0, 0.1, 1.0])
def test_bricks_behind_what_is_opaque_are_not_made(num_threads: int, share: float) -> None:
    """Only bricks that a ray meets take slots, also if these are few; the picture does not depend on their number."""
    volume = placed(np.ones((96, 96, 96), np.float32))
    bricks = bricks_of(volume, transfer_of((0, (0.9, 0.2, 0.1), 0.999), (1, (0.1, 0.5, 1.0), 0.999)))
    batch, view = batch_of(level_cut(bricks, 0), bricks), view_of(volume, "perspective", (60, 60))
    order = ordered(batch.cut, view)
    memory = MemoryShare(int(share * len(order) * BRICK_BYTES))
    with BrickRasterizer(num_threads=num_threads, memory=memory) as rasterizer, BrickRasterizer() as other:
        for _ in range(3):
            image = rasterizer.rasterize([batch], [order], view)
        (atlas,) = rasterizer.caches[id(batch.bricks)].scalars
        num_made = len(order) - atlas.num_missing(np.arange(len(order)))
        assert 0 < num_made <= min(len(order) // 2, atlas.max_slots)
        other.upload([batch], [order], view)
        assert image.tobytes() == other.rasterize([batch], [order], view).tobytes()


def test_bricks_that_rays_met_last_stay() -> None:
    atlas = Atlas(BRICK_FLOATS, 10, 3 * BRICK_BYTES)
    atlas.reserve()

    def draw(*met: int) -> None:
        """Draw a picture whose rays meet these bricks."""
        keys = np.arange(10)
        atlas.begin_picture()
        with atlas.offered(keys) as found:
            free = iter(found.free.tolist())
            for key in met:
                found.are_met[key] = True
                if found.offsets[key] < 0:
                    found.offsets[key] = next(free, -2)

    for met, kept in (([0, 1, 2, 3], [0, 1, 2]), ([2, 4], [0, 1, 2]), ([2, 5], [2, 5]), ([2, 5, 7], [2, 5, 7])):
        draw(*met)
        assert [key for key in range(10) if not atlas.num_missing(np.array([key]))] == kept
