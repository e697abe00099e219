"""What bricks are drawn with on the processor: arithmetic, tiles, lattices, and bricks in memory."""

from __future__ import annotations

import math
import threading
from fractions import Fraction
from typing import Any, cast

import numpy as np
import pytest
from brick_reference import _are_alike, _between
from brickwork import AFFINES, batch_of, bricks_of, hills, level_cut, ordered, placed, transfer_of, view_of

from renderer.bricks import PADDED_BRICK_SIZE
from renderer.draw import CPURasterizer, GLRasterizer, brick_cache, is_software, subsampling as lattices
from renderer.draw.brick_cache import brick_bytes, max_slots_in_memory
from renderer.draw.cpu.atlas import CPUAtlas
from renderer.draw.cpu.march import _clamp_to_brick, bin_bricks, draw_tiles
from renderer.draw.cpu.sample import opacity_of_depth
from renderer.draw.subsampling import refine_grid, upsample
from renderer.jit import fma, jit
from renderer.threads import ThreadPool

GLASS = transfer_of((0, (0.9, 0.2, 0.1), 0.0), (1, (0.1, 0.5, 1.0), 0.3))


@jit
def _fused(x: np.float32, y: np.float32, z: np.float32) -> np.float32:
    return fma(x, y, z)


def test_fma_rounds_once() -> None:
    """Against exact fractions; of the triples, many lose all digits of the product to a sum that rounds twice."""
    rng = np.random.default_rng(5)
    x, y = (rng.uniform(1, 2, 500).astype(np.float32) for _ in range(2))
    z = -(x * y)  # rounded: what is left is the rest of the product
    for a, b, c in zip(x, y, z, strict=True):
        exact = Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c))
        assert float(_fused(a, b, c)) == float(exact)  # a rest has few digits
    assert np.count_nonzero(x * y + z) == 0


def test_opacities_keep_their_digits() -> None:
    depths = np.concatenate([np.logspace(-37, 2, 20_000), np.linspace(0.4, 0.6, 2001)]).astype(np.float32)
    got = np.array([opacity_of_depth(x) for x in depths], np.float64)
    expected = -np.expm1(-depths.astype(np.float64))
    assert np.abs(got / expected - 1).max() < 3e-7
    assert opacity_of_depth(np.float32(0.0)) == 0.0
    assert opacity_of_depth(np.float32(np.inf)) == 1.0
    assert got.max() <= 1.0


def test_places_stay_in_the_brick() -> None:
    """Where rounding, or what is no number, would lead beyond its texels."""
    for place in (-math.inf, -1.0, 0.0, 8.5, PADDED_BRICK_SIZE - 1.0, 1e300, math.inf, math.nan):
        assert 0 < _clamp_to_brick(place) < PADDED_BRICK_SIZE - 1
    assert _clamp_to_brick(8.5) == 8.5


def test_boxes_come_to_all_tiles_that_they_lie_over() -> None:
    rng = np.random.default_rng(1)
    corners = np.sort(rng.integers(0, 70, (60, 2, 2)), axis=1)
    rectangles = corners.reshape(60, 4)
    rectangles[::7, 2] = rectangles[::7, 0]  # empty
    side, columns, rows = 16, 5, 5
    starts, none = np.empty(columns * rows + 1, np.int64), np.empty(0, np.int64)
    num = bin_bricks(rectangles, side, columns, starts, none)
    numbers = np.empty(num + 3, np.int64)
    assert bin_bricks(rectangles, side, columns, starts, numbers) == num
    for tile in range(columns * rows):
        top, left = tile // columns * side, tile % columns * side
        is_over = (
            (np.maximum(rectangles[:, 0], left) < np.minimum(rectangles[:, 2], left + side))
            & (np.maximum(rectangles[:, 1], top) < np.minimum(rectangles[:, 3], top + side))
        )  # fmt: skip
        assert numbers[starts[tile] : starts[tile + 1]].tolist() == np.flatnonzero(is_over).tolist()


@pytest.mark.parametrize("factor", [2, 4, 8])
@pytest.mark.parametrize("spread", [0.05, 0.3, 2.0])
def test_lattices_are_refined_as_the_reference_does(factor: int, spread: float) -> None:
    rng = np.random.default_rng(factor)
    nodes = rng.random((7, 9, 4)).astype(np.float32)
    nodes[:4, :5] = 0.25 + 0.01 * rng.random((4, 5, 4))
    size = 8 * factor - 1, 6 * factor + 1
    image, is_drawn = refine_grid(nodes, factor, spread, size, ThreadPool())
    columns, rows = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    is_alike = _are_alike(nodes.astype(np.float64), spread)[rows // factor, columns // factor]
    expected = ~is_alike & ((columns % factor != 0) | (rows % factor != 0))
    assert np.array_equal(is_drawn, expected)
    assert 0 < expected.mean() < 1 or spread == 2.0
    between = _between(nodes.astype(np.float64), factor, columns, rows)
    assert np.abs(image - between)[~is_drawn].max() < 1e-6
    assert not image[is_drawn].any()


def test_threads_do_not_change_what_lies_between_nodes(monkeypatch: pytest.MonkeyPatch) -> None:
    nodes, size = np.random.default_rng(3).random((7, 9, 4)).astype(np.float32), (31, 25)
    monkeypatch.setattr(lattices, "_MIN_PIXELS_PER_THREAD", 1)
    pictures = []
    for num in (1, 3):
        threads = ThreadPool(num)
        image, is_drawn = refine_grid(nodes, 4, 0.5, size, threads)
        pictures.append([each.tobytes() for each in (image, is_drawn, upsample(nodes, 4, size, threads))])
        threads.release()
    assert pictures[0] == pictures[1]


def brick(keys: Any) -> Any:
    """Texels that tell of their key."""
    return np.broadcast_to(
        np.asarray(keys, np.float32)[:, None, None, None],
        (len(keys), PADDED_BRICK_SIZE, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE),
    )


def content(atlas: CPUAtlas, keys: Any) -> list[float]:
    slots = atlas.upload(np.asarray(keys), pytest.fail)
    return [float(atlas.texels[first]) for first in atlas.texel_offsets(slots)]


def test_bricks_stay_where_they_are_when_there_are_more() -> None:
    """A copy would take memory that nobody reckons with."""
    atlas = CPUAtlas(1, 1000)
    atlas.reserve(10)
    atlas.upload(np.arange(10), brick)
    texels = atlas.texels
    atlas.reserve(500)
    assert atlas.texels is texels
    assert atlas.num_missing(np.arange(10)) == 0
    assert content(atlas, np.arange(10)) == list(range(10))
    assert len(atlas.texels) == 1000 * PADDED_BRICK_SIZE**3  # no more than there are bricks
    atlas.release()
    assert atlas.num_missing(np.arange(10)) == 10
    assert len(atlas.texels) == 0


def test_bricks_that_were_drawn_longest_ago_go_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(brick_cache, "MAX_ATLAS_BYTES", 4 * brick_bytes(1))
    assert max_slots_in_memory(1, 1000) == 4
    assert max_slots_in_memory(1, 3) == 3
    atlas = CPUAtlas(1, 1000)
    atlas.reserve(1000)
    for keys in map(np.array, ([1, 2], [3, 4], [1], [7, 8])):
        atlas.upload(keys, lambda missing, keys=keys: brick(keys[missing]))
    assert [atlas.num_missing(np.array([key])) for key in (1, 2, 3, 4, 7, 8)] == [0, 1, 1, 0, 0, 0]
    assert content(atlas, [8, 1, 7]) == [8, 1, 7]


def test_an_atlas_with_room_for_less_than_a_brick_has_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(brick_cache, "MAX_ATLAS_BYTES", 1)
    assert CPUAtlas(4, 10).max_slots == 1


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("llvmpipe (LLVM 15.0.6, 256 bits), GL 4.5 (Core Profile) Mesa 22.3.6", True),
        ("softpipe, GL 3.3 (Core Profile) Mesa 22.3.6", True),
        ("ANGLE (Google, Vulkan 1.3.0 (SwiftShader Device (Subzero))), GL 3.3", True),
        ("NVIDIA H100 80GB HBM3/PCIe/SSE2, GL 4.6.0 NVIDIA 550.54.15", False),
        ("Mesa Intel(R) UHD Graphics 620 (KBL GT2), GL 4.6", False),
    ],
)
def test_drivers_that_draw_on_the_processor(name: str, expected: bool) -> None:
    assert is_software(name) == expected


def test_threads_end_with_the_rasterizer() -> None:
    before = threading.active_count()
    bricks = bricks_of(placed(hills((20, 30, 40), 9.0), AFFINES["straight"]), GLASS)
    view = view_of(bricks.volume, "perspective", (60, 50))
    batch = batch_of(level_cut(bricks, 0), bricks)
    with GLRasterizer(brick_backend="processor", num_threads=3) as gl:
        gl.rasterize(batch, ordered(batch.cut, view), view)
        assert threading.active_count() > before
    assert threading.active_count() == before


def test_loops_are_compiled_once_for_any_number_of_threads() -> None:
    """What a thread is given has one type. The picture has more tiles than there are tasks."""
    bricks = bricks_of(placed(hills((20, 30, 40), 9.0), AFFINES["straight"]), GLASS)
    view = view_of(bricks.volume, "perspective", (640, 480))
    batch = batch_of(level_cut(bricks, 0), bricks)
    for num_threads in (1, 3):
        drawer = CPURasterizer(num_threads=num_threads)
        drawer.rasterize(batch, ordered(batch.cut, view), view)
        drawer.release()
    assert {tiles.layout for tiles, *_ in cast(Any, draw_tiles).signatures} == {"C"}
