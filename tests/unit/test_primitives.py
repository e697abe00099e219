"""Splats and bricks as the schedules see them: how many there are at a tolerance, and what drawing them takes."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import Any, Literal, cast

import numpy as np
import pytest
from film_stages import PLAIN, SPLATS, stage_of, waves
from splatting import look, place_splats

from renderer.bricks import BRICK_SIZE, Bricks, ScreenSampling, brick_cut_sizes, cut_bricks
from renderer.frame import DrawList, SplatLOD, Stage, make_primitive, num_samples, view_of
from renderer.scene import AnnotationSpec, ControlPoint, ErrorSpec, SplatSpec, TransferSpec
from renderer.splats import SplatBatch
from renderer.view import View, ray_setup, visible_order
from renderer.volume import Volume, make_volume

SIZE = 70  # voxels along the longest side: bricks of three levels, some of which the border cuts


def lumps() -> Volume:
    """Return a volume that is mostly empty, with structure of every size."""
    rng = np.random.default_rng(3)
    z, y, x = np.indices((40, 56, SIZE))
    values = np.zeros(z.shape)
    for _ in range(12):
        centre, radius = rng.uniform(0, 1, 3) * z.shape, rng.uniform(1, 9)
        distance = np.sqrt(((np.stack([z, y, x], axis=-1) - centre) ** 2).sum(axis=-1))
        values = np.maximum(values, 255 * np.clip(1.5 - distance / radius, 0, 1))
    return make_volume(values.astype(np.uint8), np.diag([1.0, 1.2, 0.8, 1.0]), "lumps")


@pytest.fixture(scope="module", params=["optical", "rms", "scalar"])
def stage(request: pytest.FixtureRequest) -> Stage:
    error = {"optical": ErrorSpec(0.1), "rms": ErrorSpec(0.1, "rms"), "scalar": ErrorSpec(9.0, "rms", "scalar")}[
        request.param
    ]
    return stage_of(replace(PLAIN, error=error), lumps())


@pytest.fixture
def primitive(stage: Stage) -> Any:
    return make_primitive(stage)


def bricks_of(stage: Stage) -> Bricks:
    assert stage.layers[0].bricks is not None
    return stage.layers[0].bricks


# How many bricks


@pytest.mark.parametrize(("finest_level", "least_steps"), [(0, 5), (1, 1), (2, 0), (9, 0)])
def test_sizes_are_those_of_the_cuts(stage: Stage, finest_level: int, least_steps: int) -> None:
    """At every split threshold and just above it, the size is the largest of that cut and of all coarser ones."""
    bricks = bricks_of(stage)
    sizes = brick_cut_sizes([bricks], finest_levels=[finest_level], finest_levels_at_zero=[finest_level])
    assert len(sizes.split_thresholds) >= least_steps
    steps = [math.inf, *sizes.split_thresholds.tolist(), 0.0]
    at_steps = [len(cut_bricks(bricks, step, finest_level=finest_level)) for step in steps]
    above = [len(cut_bricks(bricks, math.nextafter(step, math.inf), finest_level=finest_level)) for step in steps[1:]]
    assert sizes.counts.tolist() == np.maximum.accumulate(at_steps[:-1]).tolist()
    assert above == at_steps[:-1]
    assert sizes.num_cells_at_zero == max(at_steps)


@pytest.mark.parametrize("num", [1, 2, 5, 8, 9, 20, 1000])
def test_the_finest_cut_within_a_budget_of_bricks(stage: Stage, primitive: Any, num: int) -> None:
    bricks, tolerance = bricks_of(stage), primitive.tolerance_for_cells(num)
    assert 1 <= len(cut_bricks(bricks, tolerance)) <= num
    sizes = brick_cut_sizes([bricks], finest_levels=[0], finest_levels_at_zero=[0])
    finer = sizes.split_thresholds[sizes.split_thresholds < tolerance]
    if tolerance > 0 and len(finer):
        assert len(cut_bricks(bricks, float(finer[0]))) > num


def test_a_transparent_volume_needs_no_bricks() -> None:
    points = (ControlPoint(0.0, (1.0, 1.0, 1.0), 0.0),)
    scene = PLAIN.with_layers(transfer_function=TransferSpec(points))
    primitive = make_primitive(stage_of(scene, waves("uint8")))
    assert primitive.tolerance_for_cells(3) == 0.0 and primitive.work(0.0) == 0.0


@pytest.mark.parametrize("tolerance", [0.3, 0.0])
def test_no_brick_is_finer_than_the_finest_level(tolerance: float) -> None:
    """The lines of the overlay have the colours of their cells."""
    scene = replace(PLAIN, error=ErrorSpec(tolerance, finest_level=1), annotation=AnnotationSpec(octree=True))
    lod = make_primitive(stage_of(scene, lumps())).make_lod(tolerance, lambda name: None)
    (lines,), (batch,) = lod.lines, lod.batches
    assert batch.cut.levels.min() == 1
    assert set(lines.vertices[:, 6].tolist()) == set(batch.cut.levels.tolist())


# Sizes in a film on a budget of time


@pytest.mark.parametrize("size", [1.0, 3.0, 30.0, 1234.0, 1.9e6])
def test_sizes_and_tolerances_invert_each_other(primitive: Any, size: float) -> None:
    """Tolerances have two digits, and are off by up to 5 %."""
    assert primitive.lod_size(primitive.tolerance_for_size(size), 7) == pytest.approx(size, rel=0.05)


def test_sizes_end_at_tolerance_0_and_more_is_drawn_at_smaller_ones(primitive: Any) -> None:
    assert primitive.tolerance_for_size(2e6) == primitive.tolerance_for_size(1e30) == 0.0
    assert primitive.lod_size(0.0, 7) == primitive.lod_size(1e-300, 7) == 2e6
    assert primitive.lod_size(math.inf, 1) == primitive.lod_size(1e300, 1) == 1.0
    works = [primitive.work(primitive.tolerance_for_size(4.0**k)) for k in range(11)]
    assert all(more > 1.2 * less for less, more in itertools.pairwise(works[:6]))
    assert works[-1] > 10 * works[0]


# What drawing takes


def sampled(lod: Any, sampling: ScreenSampling) -> Any:
    return replace(lod, batches=[replace(lod.batches[0], screen_sampling=sampling)])


def counted(lod: Any, view: View) -> float:
    """Count the samples along the rays through the pixels' centres, and six more for each brick on the way."""
    (batch,) = lod.batches
    frame, volume = ray_setup(batch.cut.volume, batch.model_unit, view), batch.cut.volume
    width, height = view.size
    column, row = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
    place = np.stack([np.ones_like(column), column, row], axis=-1).reshape(-1, 3)
    origins, directions = place @ frame.origins.T, place @ frame.directions.T
    num = 0.0
    for box, level, step in zip(batch.cut.visible_bounds, batch.cut.levels, batch.steps, strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = ((corner - volume.centre_index - origins) / directions for corner in box)
        start = np.maximum(np.minimum(low, high).max(axis=1), frame.start)
        way = np.maximum(low, high).min(axis=1) - start
        cells = way[way > 0] * np.linalg.norm(directions[way > 0], axis=1) / 2.0**level
        num += float((np.ceil(cells / step) + 6).sum())
    return num


@pytest.mark.parametrize("tolerance", [3.0, 0.3, 1e-3])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_the_workload_equals_counted_samples(projection: str, tolerance: float) -> None:
    """Pixels are counted by their centres, and in perspective a brick is not as wide at its back as at its front."""
    stage = stage_of(PLAIN, lumps())
    lod = make_primitive(stage).make_lod(tolerance, lambda name: None)
    target = stage.layers[0].volume.centre
    view = look(projection, size=(120, 90), target=tuple(target), distance=150.0)
    orders = lod.orders(view)
    lod = sampled(lod, ScreenSampling((1,), 0.0, 0.0))
    assert len(orders[0][1][0]) == lod.num_cells
    assert lod.num_pixels(orders, view) == pytest.approx(counted(lod, view), rel=0.08)


@pytest.fixture(scope="module")
def lod() -> Any:
    return make_primitive(stage_of(PLAIN, lumps())).make_lod(0.1, lambda name: None)


def test_subsampled_pixel_grids_cost_less(lod: Any) -> None:
    """The coarser the grid, the less it costs; but pixels that differ are looked at in addition."""
    view = look(target=tuple(lod.batches[0].origin), distance=150.0)
    orders = lod.orders(view)

    def load(*strides: int, spread: float = 0.1) -> float:
        return sampled(lod, ScreenSampling(strides, spread, 0.0)).num_pixels(orders, view)

    assert load(4) < load(4, 2) < load(4, 1) < load(1)
    assert load(4) < load(2) < load(1) < load(2, 1, spread=0.001)
    assert load(4, 1, spread=1.0) < load(4, 1, spread=0.1) < load(4, 1, spread=0.01)


def test_several_rays_a_pixel_cost_more(lod: Any) -> None:
    """Only where every pixel is drawn: pixels of subsampled grids have one ray, and none has more than 16."""
    view = look(target=tuple(lod.batches[0].origin), distance=150.0)
    orders = lod.orders(view)

    def load(*strides: int, contrast: float, is_scouted: bool = False) -> float:
        sampling = ScreenSampling(strides, 0.1, 0.0, contrast, 2 * contrast, is_scouted)
        return sampled(lod, sampling).num_pixels(orders, view)

    assert load(1, contrast=math.inf) < load(1, contrast=0.15) < load(1, contrast=0.07)
    assert load(1, contrast=0.15) < load(1, contrast=0.15, is_scouted=True)
    assert load(1, contrast=0.07) < load(1, contrast=0.002) == load(1, contrast=0.001)
    assert load(4, 2, contrast=math.inf) == load(4, 2, contrast=0.02, is_scouted=True)


def test_bricks_out_of_view_take_no_samples(lod: Any) -> None:
    view = look(target=(1e4, 0.0, 0.0), distance=10.0)
    assert lod.num_pixels(lod.orders(view), view) == 0


def test_samples_around_the_eye_are_bounded(lod: Any) -> None:
    """The projection of a brick around the eye is undefined; no ray in it is longer than its diagonal."""
    view = look(target=tuple(lod.batches[0].origin), distance=1e-3, size=(40, 30))
    lod = sampled(lod, ScreenSampling((1,), 0.0, 0.0))
    (batch,), ((_, (order,)),) = lod.batches, lod.orders(view)
    longest = BRICK_SIZE * math.sqrt(3) * 1.5 / batch.steps.min() + 7
    assert 0 < num_samples(batch, order, view) < len(order) * 40 * 30 * longest


# What drawing splats takes


SIZE_PX = 64, 48
FRONT = look("orthographic", size=SIZE_PX, azimuth=0.0, elevation=0.0)


def draw_list_of(batch: SplatBatch, *shares: float) -> DrawList:
    order = visible_order(batch, FRONT)
    lod: Any = SplatLOD(0.1, [batch], [], pytest.fail)
    return DrawList(cast(Any, None), 0, lod, FRONT, [(share, [order]) for share in shares], 0.0)


def num_pixels_of(draw_list: DrawList) -> float:
    return draw_list.lod.num_pixels(draw_list.orders, draw_list.view)


def covered_pixels(batch: SplatBatch, radius_px: float) -> int:
    """Pixels whose centres lie in the squares around the footprints, each footprint by itself."""
    width, height = SIZE_PX
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    total = 0
    for center in batch.vertices[:, :3] * batch.model_unit + batch.origin:
        x, y, _ = FRONT.view_from_world(center) * FRONT.scale_px
        total += int((np.maximum(abs(columns - width / 2 - x), abs(rows - height / 2 + y)) < radius_px).sum())
    return total


def test_what_a_frame_draws_against_a_count() -> None:
    batch = place_splats(np.random.default_rng(4).uniform(-0.35, 0.35, (50, 3)), 1.6 / FRONT.scale_px)
    num_pixels, count = num_pixels_of(draw_list_of(batch, 1.0)), covered_pixels(batch, batch.footprint.cutoff * 1.6)
    # A square of 10 x 10 pixels has as many centres in it, give or take half a row and half a column.
    assert num_pixels == pytest.approx(count, rel=0.1 / math.sqrt(50) * 3)


def test_a_few_large_cells_among_many_small_ones_are_all_counted() -> None:
    """They are the first of a batch; a sample would hit or miss them, and they cover most of what is covered."""
    rng = np.random.default_rng(6)
    centers = rng.uniform(-0.35, 0.35, (60_000, 3))
    axes = np.where(np.arange(len(centers)) < 20, 0.08, 0.002)[:, None, None] * np.eye(3)
    batch = place_splats(centers, axes)
    large, small = place_splats(centers[:20], axes[:20]), place_splats(centers[20:], axes[20:])
    total, *parts = (num_pixels_of(draw_list_of(each, 1.0)) for each in (batch, large, small))
    assert total == pytest.approx(sum(parts), rel=0.01)


def test_every_order_is_drawn() -> None:
    batch = place_splats(np.random.default_rng(5).uniform(-0.3, 0.3, (20, 3)), 0.05)
    one, three = (draw_list_of(batch, *shares).typical_seconds for shares in ((1.0,), (0.5, 0.3, 0.2)))
    assert three - 5e-3 == pytest.approx(3 * (one - 5e-3))  # the rest is a frame's


@pytest.mark.parametrize(("order", "is_blended"), [("depth", True), ("unmixed", False), ("boxes", False)])
def test_only_orders_by_depth_are_blended(order: Literal["depth", "unmixed", "boxes"], is_blended: bool) -> None:
    """The first frame looks along an axis, past which neighbours change their order."""
    stage = stage_of(replace(SPLATS, splat=SplatSpec("gaussian", order=order)))
    orders = make_primitive(stage).make_lod(0.1, lambda name: None).orders(view_of(stage, 0))
    assert (len(orders) > 1) == is_blended and sum(share for share, _ in orders) == pytest.approx(1)


def test_what_is_out_of_view_costs_nothing() -> None:
    batch = place_splats([[50.0, 0, 0]], 0.05)
    assert num_pixels_of(draw_list_of(batch, 1.0)) == 0
    assert draw_list_of(batch, 1.0).typical_seconds == 5e-3  # a frame's alone
