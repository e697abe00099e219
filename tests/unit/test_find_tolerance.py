"""Tests of the search for a tolerance on a stage: frames, trials and result."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from film_stages import SPLATS
from machines import Painter

from renderer.accuracy import ExactPictures, FoundTolerances, Trial, Truth, find_tolerances
from renderer.frame import Stage, make_primitive, prepare_stage
from renderer.scene import AnnotationSpec, CameraSpec, ErrorSpec, MetricTarget, OutputSpec, RockerPath, TurntablePath
from renderer.splats import SplatBatch
from renderer.truth import Convergence, PixelMeans
from renderer.view import View

NUM_FRAMES = 24
SHAPE = (12, 16)


@pytest.fixture(scope="module")
def stage() -> Stage:
    """Return the stage of a scene that has an accuracy as its goal, and an overlay."""
    scene = replace(
        SPLATS,
        camera=CameraSpec(TurntablePath(NUM_FRAMES, elevation=20.0)),
        output=OutputSpec(Path("unused.mp4"), size=SHAPE[::-1]),
        error=ErrorSpec(goal=MetricTarget("psnr", 30.0)),
        annotation=AnnotationSpec(octree=True),
    )
    return prepare_stage(scene, clock=lambda: 0.0, num_threads=1)


def grey(batch: SplatBatch, view: View) -> tuple[float, ...]:
    """Return a grey that approaches 0.5 as splats are added, and is furthest from it when seen from -y."""
    return (*[0.5 + error_of(len(batch.vertices), view)] * 3, 1.0)


def error_of(num_splats: int, view: View) -> float:
    towards = float(np.asarray(view.eye)[1] < 0)
    return (0.5 + 0.1 * towards) / math.sqrt(num_splats)


class Truths:
    """Returns an even grey for every frame, and remembers the frames, each of which is asked for once."""

    def __init__(self, *, covered: bool = True) -> None:
        self.asked: set[int] = set()
        self._covered = covered

    def __call__(self, frame: int) -> Truth:
        assert frame not in self.asked
        self.asked.add(frame)
        convergence = Convergence((0.5,), (0.0,), (SHAPE[0] * SHAPE[1],))
        means = PixelMeans(np.full((*SHAPE, 3), 0.5), np.zeros((*SHAPE, 3)))
        return Truth(frame, means, np.full(SHAPE, self._covered), convergence)


def search(
    stage: Stage,
    want: MetricTarget,
    frames: Sequence[int] = range(NUM_FRAMES),
    find_truth: Callable[[int], Truth] | None = None,
    trials: list[Trial] | None = None,
    paint: Callable[[SplatBatch, View], npt.ArrayLike] = grey,
) -> FoundTolerances:
    on_trial = [].append if trials is None else trials.append  # type: ignore[var-annotated]
    exact, clock = ExactPictures(want, find_truth or Truths()), lambda: 0.0
    return find_tolerances(stage, frames, exact, Painter(paint), is_constant=True, clock=clock, on_trial=on_trial)


def test_the_coarsest_tolerance_that_passes_on_all_frames_is_found(stage: Stage) -> None:
    """More splats are always better here, so that the worst side limits the tolerance."""
    want = MetricTarget("rmse", 0.03)
    trials: list[Trial] = []
    found = search(stage, want, trials=trials)
    enough = (0.6 / want.value) ** 2
    two_digits = (float(f"{number}e{power}") for power in (-1, -2, -3) for number in range(99, 9, -1))
    rungs = (number for number in (10.0, *two_digits) if make_primitive(stage).work(number) >= enough)
    tolerance = next(rungs)
    assert found.is_reachable and found.by_frame == dict.fromkeys(range(NUM_FRAMES), tolerance)
    final = [trial for trial in trials if trial.tolerance == tolerance]
    assert tuple(sorted(trial.frame for trial in final)) == found.tried
    assert found.worst in final
    assert found.worst.value == max(trial.value for trial in final) <= want.value
    assert len({(trial.tolerance, trial.frame) for trial in trials}) == len(trials), "a picture was drawn twice"


@pytest.mark.parametrize("frames", [range(6, 12), [1, 5, 20], [7]])
def test_only_frames_of_the_film_are_tried(stage: Stage, frames: Sequence[int]) -> None:
    truths = Truths()
    found = search(stage, MetricTarget("psnr", 20.0), frames, truths)
    assert set(found.tried) == truths.asked <= set(frames)
    assert list(found.tried) == sorted(set(found.tried))
    assert len(found.tried) == min(len(frames), len(found.tried)) >= min(len(frames), 5)


def test_both_ends_of_an_open_path_are_tried(stage: Stage) -> None:
    rocker = replace(stage, scene=replace(stage.scene, camera=CameraSpec(RockerPath(NUM_FRAMES))))
    for of, frames in ((stage, range(NUM_FRAMES // 2)), (rocker, range(5, 20))):
        found = search(of, MetricTarget("psnr", 20.0), frames)
        assert {frames[0], frames[-1]} <= set(found.tried)


def test_equal_pictures_stay_equal(stage: Stage) -> None:
    """Although float32 cannot hold 0.1, the background."""
    behind = replace(stage.scene.output, background=(0.1, 0.1, 0.1))
    empty = replace(stage, scene=replace(stage.scene, output=behind))

    def find_truth(frame: int) -> Truth:
        return replace(Truths()(frame), means=PixelMeans(np.full((*SHAPE, 3), 0.1), np.zeros((*SHAPE, 3))))

    want = MetricTarget("psnr", 90.0)
    assert search(empty, want, range(3), find_truth, paint=lambda *_: 0.0).worst.value == math.inf


def test_a_film_of_nothing_is_reported(stage: Stage) -> None:
    for covered in (False, True):
        exact = ExactPictures(MetricTarget("psnr", 20.0), Truths(covered=covered))
        options: dict[str, Any] = {"is_constant": True, "clock": lambda: 0.0, "on_trial": [].append}
        find_tolerances(stage, range(NUM_FRAMES), exact, Painter(grey), **options)
        assert exact.shows_volume == covered


def test_targets_know_their_direction_and_their_unit() -> None:
    for want, better, worse in ((MetricTarget("psnr", 38.0), 38.5, 37.9), (MetricTarget("flip", 0.1), 0.0, 0.2)):
        assert want.margin(better) > 0 > want.margin(worse)
        assert want.margin(want.value) == 0
        assert want.margin(math.nan) == -math.inf
    assert MetricTarget("ssim", 0.9).margin(0.95) > 0 > MetricTarget("rmse", 0.01).margin(0.02)
    assert str(MetricTarget("psnr", 38.0)) == "psnr 38.00 dB"
    assert MetricTarget("psnr", 38.0).format(math.inf) == "psnr inf dB"
    assert MetricTarget("rmse", 0.01).format(0.0087654) == "rmse 0.008765"
