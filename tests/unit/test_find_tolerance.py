"""The search on a stage: which frames are tried, what is drawn, and what is said to have been found."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from renderer.draw import CellEdges
from renderer.frame import Stage, make_primitive, prepare_stage
from renderer.scene import (
    CameraSpec,
    ControlPoint,
    ErrorSpec,
    MetricTarget,
    OutputSpec,
    ProceduralSource,
    RockerPath,
    Scene,
    SplatSpec,
    TransferSpec,
    TurntablePath,
    VolumeSpec,
)
from renderer.splats import SplatBatch
from renderer.study import ToleranceSearchResult, Trial, Truth, TruthCache, find_tolerance
from renderer.study.tolerance_search import two_digit_numbers
from renderer.study.truths import round_to_float32
from renderer.truth import Convergence
from renderer.view import View
from tests.support.machines import NothingLasting

NUM_FRAMES = 24
SHAPE = (12, 16)


@pytest.fixture(scope="module")
def stage() -> Stage:
    """Of a scene that asks for an accuracy itself, with lines over its picture."""
    points = ControlPoint(50.0, (0.0, 0.0, 0.0), 0.0), ControlPoint(255.0, (1.0, 1.0, 1.0), 0.6)
    scene = Scene(
        volume=VolumeSpec(ProceduralSource("engine_block", (24, 24, 12))),
        transfer_function=TransferSpec(points, 1.0),
        camera=CameraSpec(TurntablePath(NUM_FRAMES, elevation=20.0)),
        output=OutputSpec(Path("unused.mp4"), size=SHAPE[::-1]),
        error=ErrorSpec(goal=MetricTarget("psnr", 30.0)),
        splat=SplatSpec("gaussian"),
        overlay="octree",
    )
    return prepare_stage(scene, clock=lambda: 0.0, num_threads=1)


class Grey(NothingLasting):
    """Draws an even grey that comes nearer to 0.5 the more splats there are, and is furthest from it seen from -y."""

    def rasterize(self, batch: SplatBatch, order: npt.NDArray[np.uint32], view: View) -> npt.NDArray[np.float32]:
        return np.full((*SHAPE, 4), (*[0.5 + error_of(len(batch.vertices), view)] * 3, 1.0), np.float32)

    def rasterize_edges(self, edges: CellEdges, view: View) -> npt.NDArray[np.float32]:
        raise AssertionError("lines are no error")


def error_of(num_splats: int, view: View) -> float:
    towards = float(np.asarray(view.eye)[1] < 0)
    return (0.5 + 0.1 * towards) / math.sqrt(num_splats)


class Truths:
    """Even grey on every frame; remembers for which frames it was asked."""

    def __init__(self, *, covered: bool = True) -> None:
        self.asked: set[int] = set()
        self._covered = covered

    def __call__(self, frame: int) -> Truth:
        self.asked.add(frame)
        convergence = Convergence((0.5,), (0.0,), (SHAPE[0] * SHAPE[1],))
        return Truth(frame, np.full((*SHAPE, 3), 0.5), np.full(SHAPE, self._covered), convergence)


def search(
    stage: Stage,
    want: MetricTarget,
    frames: Sequence[int] = range(NUM_FRAMES),
    truth_of: Callable[[int], Truth] | None = None,
    told: list[Trial] | None = None,
) -> ToleranceSearchResult:
    on_trial = [].append if told is None else told.append  # type: ignore[var-annotated]
    return find_tolerance(
        stage, frames, want, Grey(), truth_of=truth_of or Truths(), clock=lambda: 0.0, on_trial=on_trial
    )


def test_the_coarsest_that_is_good_on_all_frames_that_are_tried(stage: Stage) -> None:
    """Where more splats are always better, that is the coarsest of all that is good on the worst side."""
    want = MetricTarget("rmse", 0.03)
    told: list[Trial] = []
    found = search(stage, want, told=told)
    enough = (0.6 / want.value) ** 2
    rungs = (number for number in two_digit_numbers(10.0, 0.01) if make_primitive(stage).num_cells(number) >= enough)
    assert found.tolerance == next(rungs)
    final = [trial for trial in told if trial.tolerance == found.tolerance]
    assert tuple(sorted(trial.frame for trial in final)) == found.frames
    assert found.worst in final
    assert found.worst.value == max(trial.value for trial in final) <= want.value
    assert not found.shows_nothing
    assert len({(trial.tolerance, trial.frame) for trial in told}) == len(told), "a picture was drawn twice"


@pytest.mark.parametrize(("metric", "value"), [("psnr", 150.0), ("rmse", 1e-6)])
def test_beyond_full_resolution(stage: Stage, metric: str, value: float) -> None:
    found = search(stage, MetricTarget(metric, value))  # type: ignore[arg-type]
    assert found.tolerance is None
    assert found.worst.tolerance == 0
    assert found.worst.num_cells == make_primitive(stage).num_cells(0.0)


@pytest.mark.parametrize("frames", [range(6, 12), [1, 5, 20], range(0, NUM_FRAMES, 5), [7]])
def test_only_frames_of_the_film_are_tried(stage: Stage, frames: Sequence[int]) -> None:
    truths = Truths()
    found = search(stage, MetricTarget("psnr", 20.0), frames, truths)
    assert set(found.frames) == truths.asked <= set(frames)
    assert list(found.frames) == sorted(set(found.frames))
    assert len(found.frames) == min(len(frames), len(found.frames)) >= min(len(frames), 5)


def test_both_ends_of_a_path_that_is_no_whole_loop_are_tried(stage: Stage) -> None:
    rocker = replace(stage, scene=replace(stage.scene, camera=CameraSpec(RockerPath(NUM_FRAMES))))
    for of, frames in ((stage, range(NUM_FRAMES // 2)), (rocker, range(5, 20))):
        found = search(of, MetricTarget("psnr", 20.0), frames)
        assert {frames[0], frames[-1]} <= set(found.frames)


def test_truths_are_found_once_and_kept_in_float32() -> None:
    shape, asked = (200, 300, 3), []
    exact = np.random.default_rng(4).random(shape)

    def find(frame: int) -> Truth:
        asked.append(frame)
        return Truth(frame, exact + frame, np.full(shape[:2], frame > 0), Convergence((0.5,), (0.0,), (frame,)))

    truth_of = TruthCache(find)
    tracemalloc.start()
    try:
        for frame in (0, 1, 2, 1, 0):
            truth_of(frame)
        held, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert asked == [0, 1, 2]
    assert held < 3 * 14 * (200 * 300)  # 12 bytes a pixel for the picture, 1 for where the volume is
    truth = truth_of(2)
    assert (truth.frame, truth.convergence.num_pixels, truth.on_volume.all()) == (2, (2,), True)
    assert truth.picture.dtype == np.float64
    np.testing.assert_array_equal(truth.picture, round_to_float32(exact + 2))
    np.testing.assert_array_max_ulp(truth_of(0).picture.astype(np.float32), exact.astype(np.float32), 0)


@pytest.mark.parametrize(("metric", "value"), [("psnr", 28.0), ("rmse", 0.03)])
def test_what_is_kept_of_truths_is_enough(stage: Stage, metric: str, value: float) -> None:
    """The same is found, and told in the same digits."""

    def truth_of(frame: int) -> Truth:
        truth = Truths()(frame)
        return replace(truth, picture=truth.picture + np.random.default_rng(frame).random(truth.picture.shape) / 100)

    want = MetricTarget(metric, value)  # type: ignore[arg-type]
    told: tuple[list[Trial], list[Trial]] = ([], [])
    exact = search(stage, want, truth_of=truth_of, told=told[0])
    kept = search(stage, want, truth_of=TruthCache(truth_of), told=told[1])
    assert (exact.tolerance, exact.frames, exact.worst.frame) == (kept.tolerance, kept.frames, kept.worst.frame)
    assert [want.format(trial.value) for trial in told[0]] == [want.format(trial.value) for trial in told[1]]
    assert len(told[0]) > 5


def test_equal_pictures_are_equal_as_they_are_kept(stage: Stage) -> None:
    """Though 0.1, the background, is no number of float32."""

    class Nothing(Grey):
        def rasterize(self, batch: SplatBatch, order: npt.NDArray[np.uint32], view: View) -> npt.NDArray[np.float32]:
            return np.zeros((*SHAPE, 4), np.float32)

    behind = replace(stage.scene.output, background=(0.1, 0.1, 0.1))
    empty = replace(stage, scene=replace(stage.scene, output=behind))
    truths = TruthCache(lambda frame: replace(Truths()(frame), picture=np.full((*SHAPE, 3), 0.1)))
    found = find_tolerance(
        empty, range(3), MetricTarget("psnr", 90.0), Nothing(), truth_of=truths, clock=lambda: 0.0, on_trial=[].append
    )
    assert found.worst.value == math.inf


def test_a_film_of_nothing_is_said_to_be_one(stage: Stage) -> None:
    assert search(stage, MetricTarget("psnr", 20.0), truth_of=Truths(covered=False)).shows_nothing


@pytest.mark.parametrize(
    ("want", "better", "worse"),
    [
        (MetricTarget("psnr", 38.0), 38.5, 37.9),
        (MetricTarget("ssim", 0.9), 0.95, 0.8),
        (MetricTarget("rmse", 0.01), 0.009, 0.02),
        (MetricTarget("flip", 0.1), 0.0, 0.2),
    ],
)
def test_better_is_larger_or_smaller(want: MetricTarget, better: float, worse: float) -> None:
    assert want.margin(better) > 0 > want.margin(worse)
    assert want.margin(want.value) == 0
    assert want.margin(math.nan) == -math.inf


def test_values_with_their_names_and_units() -> None:
    assert str(MetricTarget("psnr", 38.0)) == "psnr 38.00 dB"
    assert MetricTarget("psnr", 38.0).format(math.inf) == "psnr inf dB"
    assert MetricTarget("rmse", 0.01).format(0.0087654) == "rmse 0.008765"
