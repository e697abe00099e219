"""Tests of the paper's figures: numbers against closed forms, and verdicts that depend on the numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import footprints
import levels
import numpy as np
import numpy.typing as npt
import octrees
import one_splat
import opacity
import pytest
import refinement
import reproduce
from figure import Claim, FigureRenderer
from html_page import assert_can_be_heard
from machines import WithoutUploads

from renderer.draw import Rasterizer, SplatRasterizer
from renderer.pyramid import cut_pyramid
from renderer.scene import ArraySource, Scene, load_scene
from renderer.splats import SplatBatch
from renderer.view import View
from renderer.volume import Float32, UInt32

STAND_IN = "volume={procedural: {name: engine_block, shape: [40, 48, 24]}}"


def scene(name: str, *overrides: str) -> Scene:
    return load_scene(reproduce.HERE / "scenes" / name, overrides=overrides)


def renderer_of(rasterizer: Rasterizer, clock: Callable[[], float] = lambda: 0.0) -> FigureRenderer:
    return FigureRenderer(rasterizer, clock, 1)


@pytest.fixture(scope="module")
def figure_renderer(rasterizer: SplatRasterizer) -> FigureRenderer:
    return renderer_of(rasterizer)


def verdicts(claims: tuple[Claim, ...]) -> list[bool]:
    return [claim.is_confirmed for claim in claims]


def test_the_page_has_all_pictures_and_charts(figure_renderer: FigureRenderer) -> None:
    figures = {
        1: footprints.make_figure(scene("1_footprints.yaml", "output.size=[32, 32]"), figure_renderer),
        3: one_splat.make_figure(scene("3_one_splat.yaml", "output.size=[32, 32]"), figure_renderer),
    }
    text = reproduce.page(figures, {"cores": 2})
    assert_can_be_heard(text)
    assert text.count('<section id="figure-') == 2
    assert text.count("<img") == len(footprints.SUBDIVISIONS) + 1 + 3 * len(one_splat.SIDES)
    assert text.count('class="axes"') == len(footprints.SUBDIVISIONS) + 2 + (5 + 3)  # meshes, charts, legends


# 1: footprints


@pytest.fixture(scope="module")
def splat_shapes(figure_renderer: FigureRenderer) -> tuple[list[footprints.FootprintError], npt.NDArray[np.float64]]:
    return footprints.measure(scene("1_footprints.yaml", "output.size=[96, 96]"), figure_renderer)


def test_the_smooth_profile_has_the_splats_integral_and_width(splat_shapes: Any) -> None:
    """-log(1 - alpha) integrates to that of the voxel, of opacity 0.7. Radii are in units of sigma, 0.425 voxels."""
    radius, alpha = splat_shapes[1][:-1].T
    depth = -np.log1p(-alpha)
    mass = np.trapezoid(2 * math.pi * radius * depth, radius)
    assert mass * 0.425**2 == pytest.approx(-math.log(0.3), rel=1e-4)
    assert np.trapezoid(math.pi * radius**3 * depth, radius) / mass == pytest.approx(1, rel=1e-3)


def test_more_triangles_approach_the_smooth_profile(splat_shapes: Any) -> None:
    *fans, gaussian = splat_shapes[0]
    assert verdicts(footprints.check_claims(fans)) == [True, True]
    assert [fan.num_triangles for fan in fans] == [4, 18, 40, 108, 240, 992]
    assert abs(gaussian.integral_error) < 0.01


def test_fans_that_do_not_converge_are_not_confirmed(splat_shapes: Any) -> None:
    worst, *others, _ = splat_shapes[0]
    assert verdicts(footprints.check_claims([*others, worst])) == [False, True]
    off = [replace(fan, integral_error=0.06) for fan in (worst, *others)]
    assert verdicts(footprints.check_claims(off)) == [True, False]


# 2: opacity by resolution


@pytest.fixture(scope="module")
def slab(figure_renderer: FigureRenderer) -> opacity.Slab:
    shape = "volume.procedural.shape=[32, 8, 32]"
    return opacity.measure(
        scene("2_opacity.yaml", shape, "camera.distance=16", "output.size=[64, 64]"), figure_renderer
    )


def test_a_slab_has_the_opacity_of_its_closed_form(slab: opacity.Slab) -> None:
    """8 voxels of opacity a transmit (1 - a)^8. Without correction, a cell of 2^k voxels counts as one voxel."""
    for opacity_of_voxel, with_correction, without in zip(
        opacity.OPACITIES, slab.corrected, slab.uncorrected, strict=True
    ):
        assert with_correction == pytest.approx([1 - (1 - opacity_of_voxel) ** 8] * 4, abs=0.002)
        assert without == pytest.approx([1 - (1 - opacity_of_voxel) ** n for n in (8, 4, 2, 1)], abs=0.002)
    assert verdicts(opacity.check_claims(slab)) == [True, True]


def test_a_slab_without_correction_is_not_confirmed(slab: opacity.Slab) -> None:
    assert verdicts(opacity.check_claims(replace(slab, corrected=slab.uncorrected))) == [False, True]
    assert verdicts(opacity.check_claims(replace(slab, uncorrected=slab.corrected))) == [True, False]


# 3: one splat


@pytest.fixture(scope="module")
def cubes(figure_renderer: FigureRenderer) -> one_splat.SplatSeries:
    return one_splat.measure(scene("3_one_splat.yaml", "output.size=[160, 160]"), figure_renderer)


def test_one_splat_replaces_many_voxels(cubes: one_splat.SplatSeries) -> None:
    """Twice as many voxels in depth square the transparency; the scene has an opacity of 0.1."""
    assert cubes.opacity == pytest.approx(0.1)
    through = [1 - alpha for alpha in cubes.corrected]
    assert through[1:] == pytest.approx([one**2 for one in through[:-1]], rel=1e-3)
    assert cubes.uncorrected == pytest.approx([cubes.corrected[0]] * 6, rel=1e-3)
    assert verdicts(one_splat.check_claims(cubes)) == [True, True, True]


def test_splats_that_are_too_faint_are_not_confirmed(cubes: one_splat.SplatSeries) -> None:
    wrong = replace(cubes, corrected=cubes.uncorrected, uncorrected=cubes.corrected, totals=(1.0, 0.5) * 3)
    assert verdicts(one_splat.check_claims(wrong)) == [False, False, False]


# 4: levels


@pytest.fixture(scope="module")
def block(figure_renderer: FigureRenderer) -> Any:
    changes = "volume.procedural.shape=[32, 32, 32]", "camera.distance=100", "output.size=[64, 64]"
    return levels.measure(scene("4_levels.yaml", *changes, "transfer_function.unit=0.5"), figure_renderer)


def test_levels_of_a_constant_block_look_the_same(block: Any) -> None:
    """Without correction, cells twice as wide have half the optical depth in total."""
    corrected, uncorrected, num_judged, _ = block
    assert num_judged == 4
    assert [distance.num_cells for distance in corrected] == [32**3, 16**3, 8**3, 4**3, 2**3, 1]
    assert corrected[0] == uncorrected[0]
    assert (corrected[0].rmse, corrected[0].largest) == (0, 0)
    deep = [-math.log1p(-distance.mean_alpha) for distance in uncorrected[:3]]
    assert deep[:2] == pytest.approx([2 * deep[1], 2 * deep[2]], rel=0.1)  # a mean of alphas is no mean of depths
    assert verdicts(levels.check_claims(corrected[:4], uncorrected[:4])) == [True, True]


def test_levels_that_fade_are_not_confirmed(block: Any) -> None:
    corrected, uncorrected = block[0][:4], block[1][:4]
    assert verdicts(levels.check_claims(uncorrected, uncorrected)) == [False, False]
    assert verdicts(levels.check_claims(corrected, corrected)) == [True, False]


# 5: octrees


def test_octrees_grow_as_the_error_falls(figure_renderer: FigureRenderer) -> None:
    trees, rows = octrees.measure(scene("5_octrees.yaml", STAND_IN, "output.size=[64, 64]"), figure_renderer)
    assert [octree.tolerance for octree in trees] == [8, 4, 1, 0.25]
    assert [octree.num_cells for octree in trees] == sorted(octree.num_cells for octree in trees)
    assert trees[-1].num_cells > 300
    with_lines, without = rows.values()
    assert with_lines[-1][0].tolist() != without[-1][0].tolist()


def test_every_cell_is_counted_once_in_total(figure_renderer: FigureRenderer) -> None:
    with figure_renderer.open_stage(scene("5_octrees.yaml", STAND_IN)) as stage:
        variation = octrees._variation_of_blocks(stage)
        assert variation.shape == (2, 3, 3)
        for tolerance in (100.0, 1.0, 0.0):
            cut = cut_pyramid(stage.base.layers[0].pyramid, tolerance)
            counts = octrees._cells_in_blocks(cut, variation.shape)
            assert counts.sum() == pytest.approx(len(cut))
            assert (counts[variation >= 0] > 0).all()


def test_voxels_without_data_vary_as_transparent_ones(figure_renderer: FigureRenderer) -> None:
    values = np.random.default_rng(0).choice(np.array([np.nan, 0.0, 255.0], np.float32), (24, 24, 24))
    found = []
    for shown in (values, np.nan_to_num(values)):
        volume = replace(scene("5_octrees.yaml", STAND_IN).layers[0].volume, source=ArraySource(shown))
        with figure_renderer.open_stage(scene("5_octrees.yaml", STAND_IN).with_layers(volume=volume)) as stage:
            found.append(octrees._variation_of_blocks(stage))
    np.testing.assert_array_equal(*found)
    assert (found[0] > 0).all()


def test_octrees_that_refine_elsewhere_are_not_confirmed() -> None:
    good = [octrees.Octree(2.0**-k, (100 * 8**k, 10), 20.0 + k, 1.0, 5.0 + k) for k in range(3)]
    assert verdicts(octrees.check_claims(good)) == [True, True]
    steady = [replace(octree, cells_high_variation=1.0) for octree in good]
    assert verdicts(octrees.check_claims(steady)) == [True, False]
    assert verdicts(octrees.check_claims(good[::-1])) == [False, True]
    assert replace(good[0], cells_low_variation=0.0).cell_ratio > 1e9
    assert replace(good[0], cells_low_variation=0.0, cells_high_variation=0.0).cell_ratio == 0
    small = [replace(octree, cells_by_level=(k, 1)) for k, octree in enumerate(good)]
    assert verdicts(octrees.check_claims(small)) == [True, False]


# 6: refinement


class TimedRasterizer(WithoutUploads):
    """Takes a fixed time for each splat, by its own clock, and draws nothing."""

    def __init__(self, seconds_per_splat: float) -> None:
        self.now, self._seconds_per_splat = 0.0, seconds_per_splat

    def clock(self) -> float:
        return self.now

    def rasterize(self, batches: Sequence[SplatBatch], orders: Sequence[UInt32], view: View) -> Float32:
        self.now += self._seconds_per_splat * len(orders[0])
        return np.zeros((view.size[1], view.size[0], 4), np.float32)


def timed(seconds_per_splat: float) -> tuple[list[refinement.TimedFrame], float]:
    """Return the frames, and the PSNR of the second against the third."""
    rasterizer = TimedRasterizer(seconds_per_splat)
    return refinement.measure(
        scene("6_engine.yaml", STAND_IN, "output.size=[16, 16]"), renderer_of(rasterizer, rasterizer.clock)
    )[:2]


def test_the_finest_picture_within_a_budget_is_found() -> None:
    """The block has some 15 000 visible voxels: at a millisecond each, full resolution takes more than five seconds."""
    quick, middle, full = timed(1e-3)[0]
    assert full.seconds == pytest.approx(1e-3 * full.num_primitives) and full.seconds > 5
    assert quick.is_within_budget and middle.is_within_budget
    assert quick.tolerance > middle.tolerance > full.tolerance == 0
    assert quick.num_primitives < middle.num_primitives < full.num_primitives
    assert middle.seconds > 0.5 * 5


def test_a_machine_that_is_too_slow_is_not_confirmed() -> None:
    drawings, psnr = timed(10.0)
    assert drawings[0].seconds == pytest.approx(10 * drawings[0].num_primitives)
    assert not drawings[0].is_within_budget
    assert verdicts(refinement.check_claims(drawings, psnr))[0] is False


def test_full_resolution_is_used_where_it_is_fast_enough() -> None:
    quick, middle, full = timed(1e-4)[0]
    assert full.seconds < 5
    assert quick.tolerance > 0
    assert (middle.tolerance, middle.num_primitives) == (0, full.num_primitives)
    drawings, psnr = timed(1e-6)
    assert [drawing.tolerance for drawing in drawings] == [0, 0, 0]
    assert math.isinf(psnr)


def test_slow_or_inaccurate_pictures_are_not_confirmed() -> None:
    good = [
        refinement.TimedFrame("quick", 0.2, 0.5, 0.19, 0.01, 1000, 25.0),
        refinement.TimedFrame("middle", 5.0, 0.1, 4.5, 0.01, 9000, 30.0),
        refinement.TimedFrame("full", math.inf, 0.0, 12.0, 0.01, 20000, 31.0),
    ]

    def verdicts_with(**changes: dict[str, Any]) -> list[bool]:
        drawings = [replace(drawing, **changes.get(drawing.name, {})) for drawing in good]
        return verdicts(refinement.check_claims(drawings, 36.0))

    assert verdicts_with() == [True, True, True]
    assert verdicts_with(quick={"seconds": 0.3}) == [False, True, True]
    assert verdicts_with(quick={"psnr_db": 12.0}) == [False, True, True]
    assert verdicts_with(middle={"psnr_db": 24.0}) == [True, False, True]
    assert verdicts_with(middle={"seconds": 6.0}) == [True, True, False]
