"""The cost model: rates that are found again, and a machine that changes its speed."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings, strategies as st
from splatting import look, place_splats

from renderer.frame import Workload, workload_of
from renderer.frame.budget import CostLog, CostModel, fit_costs
from renderer.frame.frame import DrawList
from renderer.frame.primitives import SplatLOD
from renderer.pyramid import Cut
from renderer.scene import TurntablePath
from renderer.splats import SplatBatch
from renderer.view import make_order_blending
from renderer.view.splat_projection import visible_order

RATES = CostModel(per_frame=4e-3, per_splat=5e-7, per_pixel=2e-9, per_written=8e-3)
FAST = CostModel(per_frame=2e-4, per_splat=3e-10, per_pixel=8e-12, per_written=1e-3)


def loads(rng: np.random.Generator, num: int) -> list[Workload]:
    """Many small splats or few large ones, written or not."""
    splats = 10 ** rng.uniform(2, 6, num)
    pixels = splats * 10 ** rng.uniform(0.5, 3, num)
    return [
        Workload(*load) for load in zip(splats.tolist(), pixels.tolist(), rng.integers(0, 2, num).tolist(), strict=True)
    ]


def rates_of(model: CostModel) -> npt.NDArray[np.float64]:
    return np.array([model.per_frame, model.per_splat, model.per_pixel, model.per_written])


@pytest.mark.parametrize("truth", [RATES, FAST], ids=["software", "fast"])
def test_rates_are_found_again(truth: CostModel) -> None:
    samples = [(load, truth.seconds(load)) for load in loads(np.random.default_rng(0), 40)]
    model = fit_costs(samples)
    # The weak equations are worth 1e-4 of a frame each, times the square of how many times off the typical rates are.
    np.testing.assert_allclose(rates_of(model), rates_of(truth), rtol=1e-2)
    assert all(abs(model.seconds(load) / seconds - 1) < 1e-2 for load, seconds in samples)


@pytest.mark.parametrize("truth", [RATES, FAST], ids=["software", "fast"])
def test_a_clock_with_noise(truth: CostModel) -> None:
    """10 % of noise on 40 frames for 4 unknowns: others are known to 10 % / sqrt(40 / 4), in root mean square."""
    off = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        samples = [(load, truth.seconds(load) * rng.normal(1, 0.1)) for load in loads(rng, 40)]
        model = fit_costs(samples)
        off.append(np.sqrt(np.mean([(model.seconds(load) / truth.seconds(load) - 1) ** 2 for load in loads(rng, 200)])))
    assert np.median(off) < 0.05
    assert max(off) < 0.15


def test_nothing_drawn_yet() -> None:
    model = fit_costs([])
    assert (rates_of(model) > 0).all()


@pytest.mark.parametrize("speed", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("num", [1, 30])
def test_one_load_tells_the_speed(num: int, speed: float) -> None:
    """Other loads cost what they would on a typical machine of that speed."""
    typical, load = fit_costs([]), Workload(2e4, 3e6, 1)
    model = fit_costs([(load, speed * typical.seconds(load))] * num)
    np.testing.assert_allclose(rates_of(model), speed * rates_of(typical), rtol=1e-9)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    samples=st.lists(
        st.tuples(
            st.builds(Workload, st.floats(0, 1e9), st.floats(0, 1e12), st.integers(0, 1)),
            st.one_of(st.just(0.0), st.floats(1e-9, 1e5)),
        ),
        max_size=8,
    )
)
def test_no_rate_is_negative_whatever_was_measured(samples: list[tuple[Workload, float]]) -> None:
    rates = rates_of(fit_costs(samples))
    assert np.isfinite(rates).all() and (rates >= 0).all() and (rates > 0).any()


def test_more_of_anything_never_takes_less() -> None:
    """Even if frames took less, the more there was to draw."""
    samples = [(Workload(1e5 * k, 1e7 * k, 1), 1.0 / k) for k in range(1, 6)]
    model = fit_costs(samples)
    grown = [model.seconds(load) for load, _ in samples]
    assert all(before <= after for before, after in pairwise(grown))
    assert grown[0] > 0.2 and grown[-1] < 1.0


def logged(seconds_of_frames: list[float], load: Workload) -> CostLog:
    log = CostLog()
    for k in range(1, 5):  # trials, before the film
        trial = Workload(load.num_splats * k / 4, load.num_pixels * k / 4, 0)
        log.add(trial, RATES.seconds(trial))
    for seconds in seconds_of_frames:
        log.add(load, seconds)
    return log


@pytest.mark.parametrize("factor", [2.0, 0.5])
def test_a_machine_that_changes_its_speed_is_followed(factor: float) -> None:
    load = Workload(1e5, 2e6, 1)
    before, after = RATES.seconds(load), factor * RATES.seconds(load)
    for num_before in (5, 40):
        for num_after in (4, 5, 8, 30):
            log = logged([before] * num_before + [after] * num_after, load)
            assert log.predict(load) == pytest.approx(after, rel=1e-9)  # the median of the last seven
            larger = Workload(1.3 * load.num_splats, 1.3 * load.num_pixels, 1)
            assert log.predict(larger) == pytest.approx(factor * RATES.seconds(larger), rel=0.1)


def test_one_slow_frame_changes_little() -> None:
    load = Workload(1e5, 2e6, 1)
    usual = RATES.seconds(load)
    for place in range(6):
        seconds = [usual] * 12
        seconds[-1 - place] *= 10
        assert logged(seconds, load).predict(load) == pytest.approx(usual, rel=1e-9)


def test_trials_alone_predict_frames() -> None:
    """All but the writing is known, and that is taken to be a typical machine's."""
    load = Workload(1e5, 2e6, 0)
    assert logged([], load).predict(load) == pytest.approx(RATES.seconds(load), rel=1e-3)


# Loads


def draw_list_of(batch: SplatBatch, *shares: float, size: tuple[int, int] = (64, 48)) -> DrawList:
    view = look("orthographic", size=size, azimuth=0.0, elevation=0.0)
    nothing = np.empty(0, np.uint8)
    volume: object = None
    cut = Cut(nothing, np.empty((0, 3), np.int32), np.empty((0, 4), np.float32), volume)  # type: ignore[arg-type]
    order = visible_order(batch, cut, view, "unmixed")
    lod = SplatLOD(0.1, batch, None, cut, "unmixed", make_order_blending(np.eye(4), TurntablePath(1)))
    return DrawList(0, lod, view, [(share, order) for share in shares], 0.0)


def covered_pixels(batch: SplatBatch, radius_px: float, size: tuple[int, int]) -> int:
    """Pixels whose centres lie in the squares around the footprints, each footprint by itself."""
    view = look("orthographic", size=size, azimuth=0.0, elevation=0.0)
    columns, rows = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    total = 0
    for center in batch.vertices[:, :3] * batch.model_unit + batch.origin:
        x, y, _ = view.view_from_world(center) * view.scale_px
        reach_px = np.maximum(abs(columns - size[0] / 2 - x), abs(rows - size[1] / 2 + y))
        total += int((reach_px < radius_px).sum())
    return total


def test_what_a_frame_draws_against_a_count() -> None:
    size, scale_px = (64, 48), look("orthographic", size=(64, 48)).scale_px
    rng = np.random.default_rng(4)
    centers = rng.uniform(-0.35, 0.35, (50, 3))
    sigma = 1.6 / scale_px
    batch = place_splats(centers, sigma)
    load = workload_of(draw_list_of(batch, 1.0))
    assert load.num_splats == 50 and load.num_written == 1
    count = covered_pixels(batch, batch.footprint.cutoff * 1.6, size)
    # A square of 10 x 10 pixels has as many centres in it, give or take half a row and half a column.
    assert load.num_pixels == pytest.approx(count, rel=0.1 / math.sqrt(50) * 3)


def test_a_few_large_cells_among_many_small_ones_are_all_counted() -> None:
    """They are the first of a batch; a sample would hit or miss them, and they cover most of what is covered."""
    rng = np.random.default_rng(6)
    centers = rng.uniform(-0.35, 0.35, (60_000, 3))
    axes = np.where(np.arange(len(centers)) < 20, 0.08, 0.002)[:, None, None] * np.eye(3)
    batch = place_splats(centers, axes)
    large, small = place_splats(centers[:20], axes[:20]), place_splats(centers[20:], axes[20:])
    total, *parts = (workload_of(draw_list_of(each, 1.0)).num_pixels for each in (batch, large, small))
    assert total == pytest.approx(sum(parts), rel=0.01)


def test_every_order_is_drawn() -> None:
    batch = place_splats(np.random.default_rng(5).uniform(-0.3, 0.3, (20, 3)), 0.05)
    one, three = (
        workload_of(draw_list_of(batch, 1.0)),
        workload_of(draw_list_of(batch, 0.5, 0.3, 0.2), is_written=False),
    )
    assert three.num_splats == 3 * one.num_splats
    assert three.num_pixels == pytest.approx(3 * one.num_pixels)
    assert (one.num_written, three.num_written) == (1, 0)


def test_what_is_out_of_view_costs_nothing() -> None:
    batch = place_splats([[50.0, 0, 0]], 0.05)
    assert workload_of(draw_list_of(batch, 1.0)) == Workload(0, 0.0, 1)
