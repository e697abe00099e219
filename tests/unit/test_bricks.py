"""Bricks, against plain numpy over the whole volume: where something is seen, and what their cells' nodes add up to."""

from __future__ import annotations

import math
from collections import defaultdict
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
from dense_bricks import (
    OBLIQUE,
    Shape,
    between_scalars,
    channels_of,
    depths_of,
    dual_cells,
    errors_of_bricks,
    errors_of_cells,
    means_over_cells,
    patches,
    per_brick,
    ranges_of_dual_cells,
    sums_over_cells,
)
from number_types import TYPES, limits

from renderer.bricks import BRICK_SIZE, RAY_ERROR_FACTOR, Bricks, cut_bricks, make_bricks
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import VISIBILITY_THRESHOLD, TransferFunction
from renderer.volume import Array, Bools, Float64, Volume, make_volume

# Thin, tiny, whole bricks, cut by the border, and levels enough for three and for five of bricks.
SHAPES: list[Shape] = [
    (1, 1, 1), (1, 40, 20), (5, 17, 33), (16, 16, 16), (48, 16, 35), (20, 1, 1), (35, 30, 65), (5, 140, 24),
]  # fmt: skip
# A mean or an error in float16 is off by 2^-11 at most, and by a few roundings of float32.
HALF_RTOL = 2.0**-11 + 2e-6
DIFFERENCE_ERROR_SHARE = 0.35


def random_transfer(rng: np.random.Generator, low: float, high: float) -> TransferFunction:
    """Return slopes, steps and thin peaks between two scalars, most of them without extinction."""
    shares = np.sort(rng.choice(np.arange(11) / 10, 6))  # steps, where one is drawn twice
    peak = rng.random() + np.array([-1e-3, 0, 1e-3])
    extinctions = np.concatenate([rng.choice([0.0, 0.0, 1.0], 6), [0.0, 1.0, 0.0]])
    order = np.argsort(np.concatenate([shares, peak]), kind="stable")
    values = low * (1 - np.clip(np.concatenate([shares, peak])[order], 0, 1))
    values = np.sort(values + high * np.clip(np.concatenate([shares, peak])[order], 0, 1))
    return TransferFunction(values, rng.random((9, 3)), extinctions[order], 1.0)


def dual_cells_shown(volume: Volume, transfer: TransferFunction) -> Bools:
    """Return whether any scalar between the corners of a dual cell is visible, [z + 1, y + 1, x + 1]."""
    low, high = ranges_of_dual_cells(volume)

    def shows(s: Float64) -> Bools:
        return np.asarray(transfer.classify(s)[1] * volume.finest_spacing >= VISIBILITY_THRESHOLD)

    shown = shows(low) | shows(high)
    ends = [-np.inf, *transfer.values, np.inf]
    for first, last in pairwise(ends):  # linear, so that its middle tells of all between
        start, end = np.maximum(low, first), np.minimum(high, last)
        shown |= (start < end) & shows(start / 2 + end / 2)
    return shown


def means_over_dual_cells(values: Float64) -> dict[tuple[int, int, int], float]:
    """Return the mean over each brick (x, y, z) of 16 voxels a side; half of the dual cells at its faces is inside."""
    means = {}
    for brick in np.ndindex(*(-(-(n - 1) // 16) for n in values.shape[::-1])):
        part = values[dual_cells((brick[0], brick[1], brick[2]), 16)]
        for axis in range(3):
            part = part.take(range(part.shape[axis] - 1), axis) / 2 + part.take(range(1, part.shape[axis]), axis) / 2
        means[brick[0], brick[1], brick[2]] = float(part.mean())
    return means


def nodes_shown(cells: Bools) -> Bools:
    """Return whether any corner of a dual cell of nodes is visible, [z + 1, y + 1, x + 1]."""
    shown = np.pad(cells, 1)
    for axis in range(3):
        shown = shown.take(range(shown.shape[axis] - 1), axis) | shown.take(range(1, shown.shape[axis]), axis)
    return np.asarray(shown)


def box_of(shown: Bools, brick: tuple[int, int, int], extent_zyx: Array) -> Float64:
    """[2, 3]: lowest and highest corner (x, y, z), in cells from the brick's own lowest one, around the dual cells that
    are shown in a brick of 16 cells a side; 0 where none is."""
    first = 16 * np.array(brick[::-1])
    z, y, x = (slice(start, start + 17) for start in first)
    inside = np.argwhere(shown[z, y, x])
    if len(inside) == 0:
        return np.zeros((2, 3))
    low = np.maximum(inside.min(axis=0) - 0.5, 0)
    high = np.minimum(inside.max(axis=0) + 0.5, np.minimum(extent_zyx - first, 16))
    return np.stack([low, high])[:, ::-1]


def bricks_of(volume: Volume, transfer: TransferFunction, num_threads: int = 1) -> Bricks:
    return make_bricks(volume, transfer, spec=PyramidSpec(), error=ErrorSpec(), num_threads=num_threads)


def hills(*points: tuple[float, float]) -> TransferFunction:
    """Return the function through points of a scalar and an extinction."""
    values, extinctions = np.array(points, np.float64).T
    return TransferFunction(values, np.tile([0.9, 0.5, 0.2], (len(points), 1)), extinctions, 1.0)


SOFT = hills((0, 0), (100, 0), (200, 1.5), (250, 0.1))
STEPS = hills((0, 0), (60, 0), (60, 0.4), (100, 0.1), (101, 2.0), (102, 0.1), (180, 1.5), (180, 0.2), (250, 0.7))


def soft(shape: Shape, dtype: str = "uint8") -> Volume:
    return make_volume((patches(shape, 0) * 250).astype(dtype), OBLIQUE, "soft")


@pytest.mark.parametrize("dtype", TYPES)
def test_visible_bounds_of_voxels_are_tight(dtype: str) -> None:
    """They enclose the dual cells with a visible scalar between their corners, and nothing else, for every type."""
    shares = []
    for seed, shape in enumerate(SHAPES[:-1]):
        rng = np.random.default_rng(seed)
        low, high = limits(dtype) if seed % 2 else (10, 100)
        values = low * (1 - patches(shape, seed)) + high * patches(shape, seed)
        values = np.clip(values, low, np.nextafter(float(high), 0)).astype(dtype)
        volume = make_volume(values, OBLIQUE, "patches")
        transfer = random_transfer(rng, float(low), float(high))
        shown = dual_cells_shown(volume, transfer)
        boxes = bricks_of(volume, transfer).levels[0].visible_bounds
        for (x, y, z), part in per_brick(values, BRICK_SIZE).items():
            box = box_of(shown, (x, y, z), np.array(shape))
            np.testing.assert_array_equal(boxes[z, y, x], box)
            shares.append(np.prod(box[1] - box[0]) / part.size)
    assert min(shares) == 0 and max(shares) == 1 and np.mean((np.array(shares) > 0) & (np.array(shares) < 1)) > 0.1


@pytest.mark.parametrize(
    ("points", "shown"),
    [
        # Between voxels of 10 and 20; a background of 10 lies around it.
        (((10, 0), (20, 1)), True),
        (((0, 1), (10, 0)), False),  # at the foot of a slope is nothing
        (((20, 0), (30, 1)), False),
        (((14.9, 0), (15, 1), (15.1, 0)), True),  # a thin peak, passed between the two
        (((15, 0), (15, 1), (15, 1), (15, 0)), False),  # of no width
        (((20, 0), (20, 1)), True),  # the upper side of a step has the value
        (((10, 1), (10, 0)), False),
        (((20, 1), (20, 0)), True),  # where all below is visible
        (((25, 1e-24), (30, 0)), True),
        (((25, 1e-26), (30, 0)), False),  # fainter than what counts
        (((25, 0),), False),
        (((25, 1),), True),
    ],
)
def test_visible_bounds_between_two_voxels(points: tuple[tuple[float, float], ...], shown: bool) -> None:
    """The step between the third and the fourth voxel shows half a cell to either side, or nothing."""
    values = np.full((1, 1, 16), 10, np.uint8)
    values[0, 0, 3:] = 20
    transfer = hills(*points)
    box = bricks_of(make_volume(values, np.eye(4), "step"), transfer).levels[0].visible_bounds[0, 0, 0]
    at_10, at_20 = transfer.classify(np.array([10.0, 20.0]))[1] >= 2.0**-80
    low = 0 if at_10 else 2.5
    high = 16 if at_20 else 3.5
    np.testing.assert_array_equal(box, [[low, 0, 0], [high, 1, 1]] if shown else np.zeros((2, 3)))


@pytest.mark.parametrize("shape", SHAPES, ids=str)
def test_visible_bounds_of_nodes_reach_to_the_next_centres(shape: Shape) -> None:
    volume = soft(shape)
    bricks = bricks_of(volume, SOFT)
    for number, level in enumerate(bricks.levels[1:], 1):
        cells = means_over_cells(depths_of(volume, SOFT), number)[..., 3] > 0
        extent = np.array(shape) / 2**number
        for x, y, z in per_brick(cells, BRICK_SIZE):
            np.testing.assert_array_equal(level.visible_bounds[z, y, x], box_of(nodes_shown(cells), (x, y, z), extent))


@pytest.mark.parametrize(
    ("shape", "dtype", "transfer"),
    [*((shape, "uint8", SOFT) for shape in SHAPES), *((shape, "float32", STEPS) for shape in SHAPES[2:-2])],
)
def test_errors_and_step_errors_equal_the_dense_reference(shape: Shape, dtype: str, transfer: TransferFunction) -> None:
    """The largest of its nodes and its halo's, of what shows between its voxels, and of their differences; and the
    root mean square, over its volume, of nodes twice as large and of what shows between voxels, or of differences."""
    volume = soft(shape, dtype)
    depths = depths_of(volume, transfer)
    between, widths, jumps = between_scalars(
        *ranges_of_dual_cells(volume), transfer.values, channels_of(transfer, volume.finest_spacing)
    )
    side = np.cbrt(volume.voxel_volume) / volume.finest_spacing
    rough, steep = means_over_dual_cells(between / widths**2), means_over_dual_cells(jumps)
    levels = bricks_of(volume, transfer).levels
    assert [level.errors.size == 1 for level in levels] == [False] * (len(levels) - 1) + [True]
    for number, level in enumerate(levels):
        errors = errors_of_bricks(volume, transfer, number)
        above = errors_of_cells(volume, depths, number + 1)
        num_voxels = sums_over_cells(np.ones(shape), number + 1)
        squares, sizes = per_brick(above**2 * num_voxels, BRICK_SIZE // 2), per_brick(num_voxels, BRICK_SIZE // 2)
        own = np.zeros(level.step_errors.shape)
        for (x, y, z), error in errors.items():
            want = error if number else 0
            np.testing.assert_allclose(level.errors[z, y, x], want, rtol=HALF_RTOL, atol=4e-7)
            own[z, y, x] = np.sqrt(squares[x, y, z].sum() / sizes[x, y, z].sum())
        for (x, y, z), around in per_brick(own, 1, halo=1).items():
            want = own[z, y, x] if own[z, y, x] > 1e-7 else around.max()
            if number == 0:
                want = np.hypot(want, 2 * side * np.sqrt(rough[x, y, z]))
            want = max(want, 2 ** (number + 1) * side * np.sqrt(steep[x, y, z]))
            np.testing.assert_allclose(level.step_errors[z, y, x], want, rtol=HALF_RTOL, atol=1e-7)
        children = defaultdict(list)
        for (x, y, z), mean in steep.items():
            children[x // 2, y // 2, z // 2].append(mean)
        steep = {brick: float(np.mean(means)) for brick, means in children.items()}


@pytest.mark.parametrize("of", ["classified", "scalar"])
def test_errors_are_in_the_unit_of_the_measure(of: Literal["classified", "scalar"]) -> None:
    """An opacity does not grow with the cell; of the scalar, which is interpolated, only the difference counts."""
    values = np.zeros((40, 4, 4), np.uint8)
    values[20:] = 1
    opaque = hills((0.25, 0), (0.5, 2), (0.75, 0))
    volume = make_volume(values, np.eye(4), "mask")
    fine, *levels = make_bricks(volume, opaque, spec=PyramidSpec(), error=ErrorSpec(measure="rms", of=of)).levels
    opacity = -math.expm1(-2.0)
    distance = opacity * math.sqrt((1 + 0.9**2 + 0.5**2 + 0.2**2) * 0.5 / 3)
    for level in levels:  # of which no cell has voxels of both kinds
        want = RAY_ERROR_FACTOR * (distance if of == "classified" else DIFFERENCE_ERROR_SHARE)
        assert level.errors.max() == pytest.approx(want, rel=1e-6)
    if of == "scalar":  # one layer of dual cells in 16
        assert fine.step_errors[1, 0, 0] == pytest.approx(DIFFERENCE_ERROR_SHARE / 4, rel=1e-6)
    else:
        assert fine.step_errors[1, 0, 0] > 0.1


def test_light_counts_at_its_brightest() -> None:
    values = np.zeros((40, 4, 4), np.uint8)
    values[20:] = 1
    volume, peak = make_volume(values, np.eye(4), "mask"), hills((0.25, 0), (0.5, 2), (0.75, 0))
    shading = ShadingSpec(ambient=0.5, diffuse=1.0, light=(1.0, 0.0, 0.0))
    bricks = make_bricks(volume, peak, spec=PyramidSpec(), error=ErrorSpec(), shading=shading)
    lit = bricks.levels[1].errors.max()
    plain = bricks_of(volume, peak).levels[1].errors.max()
    colors = 0.9**2 + 0.5**2 + 0.2**2
    assert lit / plain == pytest.approx(math.sqrt((1 + 1.5**2 * colors) / (1 + colors)))


@pytest.mark.parametrize("size", [1e-300, 1e300])
def test_step_errors_of_the_largest_and_the_smallest_errors(size: float) -> None:
    """Errors of scalars are in data units, whose squares overflow or vanish."""
    volume = make_volume(patches((20, 20, 20), 3) * size, np.eye(4), "far")
    error = ErrorSpec(measure="rms", of="scalar")
    transfer = hills((0, 1), (size, 1))
    bricks = make_bricks(volume, transfer, spec=PyramidSpec(precision="single"), error=error)
    unscaled = make_volume(volume.values / size, np.eye(4), "near")
    one = make_bricks(unscaled, hills((0, 1), (1, 1)), spec=PyramidSpec(precision="single"), error=error)
    for level, other in zip(bricks.levels, one.levels, strict=True):
        np.testing.assert_allclose(level.step_errors / size, other.step_errors, rtol=1e-5)


@pytest.mark.parametrize("shape", [(1, 1, 1), (2, 40, 2), (20, 1, 33), (37, 50, 61)])
@pytest.mark.parametrize("dtype", ["uint8", "int8", "uint16", "int16"])
def test_bricks_do_not_depend_on_the_type_of_integers(dtype: str, shape: Shape) -> None:
    """Narrow integers are measured by their bit patterns, and int32 by its scalars."""
    low, high = limits(dtype)
    values = np.rint(patches(shape, 5) * 250 + np.random.default_rng(5).integers(-3, 4, shape)).clip(low, high)
    peak = hills((-20, 0), (20, 0.1), (70, 0), (70.5, 1), (71, 0), (100, 0), (120, 0.5))
    narrow, wide = (make_volume(values.astype(each), OBLIQUE, "same") for each in (dtype, "int32"))
    for error in (ErrorSpec(), ErrorSpec(measure="rms", of="scalar")):
        one, other = (make_bricks(each, peak, spec=PyramidSpec(), error=error) for each in (narrow, wide))
        for level, of_wide in zip(one.levels, other.levels, strict=True):
            np.testing.assert_array_equal(level.visible_bounds, of_wide.visible_bounds)
            np.testing.assert_allclose(level.errors, of_wide.errors, rtol=HALF_RTOL)
            np.testing.assert_allclose(level.step_errors, of_wide.step_errors, rtol=HALF_RTOL)


def test_a_transparent_volume_has_empty_bricks() -> None:
    volume = make_volume(np.full((20, 40, 33), 7, np.int16), OBLIQUE, "clear")
    bricks = bricks_of(volume, SOFT)
    for level in bricks.levels:
        assert not level.visible_bounds.any() and not level.errors.any() and not level.step_errors.any()
    assert len(cut_bricks(bricks, 0.0)) == 0


def test_threads_change_no_byte() -> None:
    volume = soft((70, 90, 130))
    one, many = bricks_of(volume, SOFT), bricks_of(volume, SOFT, num_threads=3)
    for level, other in zip(one.levels, many.levels, strict=True):
        for name in ("visible_bounds", "errors", "step_errors"):
            assert not getattr(level, name).flags.writeable
            np.testing.assert_array_equal(getattr(level, name), getattr(other, name))


@pytest.mark.parametrize(
    ("control", "scalars", "want"),
    [
        ((0, 255), (10, 300), (10, 255)),
        ((0, 255), (-10, 30), (0, 30)),
        ((0, 255), (300, 400), (300, 400)),  # nothing but the constant beyond
        ((0, 255), (-400, -300), (-400, -300)),
        ((5, 5), (0, 10), (5 - 10 / 128, 5 + 10 / 128)),  # a step, and something around it
        ((0, 5), (0, 1e6), (0, 5)),
        ((0, 255), (255, 300), (255, 300)),
        ((0, 255), (7, 7), (0, 7)),
        ((0, 255), (-7, -7), (-7, 0)),
        ((0, 255), (0, 0), (0, 1)),
        ((-1.7e308, 1.7e308), (1.7e308, 1.7e308), (0, 1.7e308)),
    ],
)
def test_scalar_range(control: tuple[float, float], scalars: tuple[float, float], want: tuple[float, float]) -> None:
    volume = make_volume(np.array([[scalars]], np.float64), np.eye(4), "two")
    bricks = bricks_of(volume, hills((control[0], 0), (control[1], 1)))
    assert bricks.scalar_range == pytest.approx(want, rel=1e-15)
    assert bricks.volume_range == scalars


def test_the_scalar_range_spans_the_changes_of_the_transfer_function() -> None:
    """A ramp in front of which and behind which nothing changes: texels have their digits there. Colours of nothing are
    no change."""
    volume = make_volume(np.array([[[-1000.0, 3000.0]]]), np.eye(4), "two")
    red, blue = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    values, extinctions = np.array([-2000.0, 100, 200, 300, 4000]), np.array([0.0, 0.0, 1.0, 0.5, 0.5])
    colors = np.array([blue, red, red, blue, blue])
    bricks = bricks_of(volume, TransferFunction(values, colors, extinctions, 1.0))
    assert bricks.scalar_range == (100, 300)
    far = make_volume(np.array([[[-(2.0**30), 2.0**30]]]), np.eye(4), "far")
    bricks = bricks_of(far, TransferFunction(values, colors, extinctions, 1.0))
    assert bricks.scalar_range == (200 - 1024, 200 + 1024)  # or shares are beyond what texels can have
    spike = np.array([-3200.0, 100, 101, 102, 3200])
    bricks = bricks_of(volume, TransferFunction(spike, colors, np.array([0.0, 0, 1, 0, 0]), 1.0))
    assert bricks.scalar_range == (51, 151)  # no less than 1/64
    constant = TransferFunction(values, np.array(5 * [red]), np.full(5, 0.5), 1.0)
    assert bricks_of(volume, constant).scalar_range == (-1000, 3000)
