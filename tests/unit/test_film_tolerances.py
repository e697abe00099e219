"""The search for tolerances along a film, with pictures whose error is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from film_stages import SPLATS, stage_of_kind

from renderer.accuracy import ErrorSamples, ExactRays, FoundTolerances, Probe, Trial, find_tolerances
from renderer.frame import Stage, prepare_stage
from renderer.scene import MetricTarget
from renderer.volume import Float32

# The mean squared error of a frame at a tolerance.
Error = Callable[[float, int], float]
FRAMES = range(100)


class Exact:
    """Exact pixels that find the error that a picture has in place of its radiance. deviation: as in ErrorSamples."""

    deviation = 0.1

    def compare_radiance(self, radiance: Float32) -> Probe:
        mean = float(radiance[0, 0, 0])
        variance = 1024 * (self.deviation * mean) ** 2
        return Probe(ErrorSamples(1024, mean, variance, mean), 0.0)


class Prober:
    def __init__(self, *_: object, **__: object) -> None: ...

    def on(self, _: object) -> Prober:
        return self

    def exact_pixels(self, *_: object) -> Exact:
        return Exact()


class Picture:
    image, num_cells = None, 7

    def __init__(self, number: int, mean: float) -> None:
        self.number, self.radiance, self.stage = number, np.full((1, 1, 4), mean), None


@pytest.fixture
def stage() -> Stage:
    return stage_of_kind("plain")


def search(
    stage: Stage, error: Error, decibels: float, monkeypatch: pytest.MonkeyPatch, trials: list[Trial] | None = None
) -> FoundTolerances:
    def render(at: Stage, numbers: list[int], *_: object, **__: object) -> Any:
        tolerance = at.scene.error.tolerance
        return [Picture(number, error(tolerance, number)) for number in numbers]

    monkeypatch.setattr("renderer.accuracy.references.FrameProber", Prober)
    monkeypatch.setattr("renderer.accuracy.search.render_frames", render)
    rays, tell = ExactRays(stage, MetricTarget("psnr", decibels), num_threads=1), ([] if trials is None else trials)
    options: dict[str, Any] = {"is_constant": stage.scene.needs_opengl, "clock": lambda: 0.0, "on_trial": tell.append}
    return find_tolerances(stage, FRAMES, rays, None, **options)  # type: ignore[arg-type]


def test_each_frame_gets_the_coarsest_tolerance_that_is_good_enough(stage: Stage, monkeypatch) -> None:
    """Frames differ by 10 dB along the film, and get what they need, and little more."""
    trials: list[Trial] = []

    def error(tolerance: float, frame: int) -> float:
        return (1e-3 + tolerance**2 / 50) * 10 ** (-np.sin(2 * np.pi * frame / 100) / 2) / 100

    found = search(stage, error, 45.0, monkeypatch, trials)
    assert found.is_reachable
    assert [*found.by_frame] == [*FRAMES]
    margins = [-10 * np.log10(error(tolerance, frame)) - 45 for frame, tolerance in found.by_frame.items()]
    assert min(margins) >= 0
    assert np.mean(margins) < 3
    assert len({*found.by_frame.values()}) > 3
    assert len(trials) == len({(trial.tolerance, trial.frame) for trial in trials}) < 80
    assert found.worst.value == pytest.approx(45 + min(margins[frame] for frame in found.tried))


def test_a_bad_stretch_between_key_frames_is_found(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    def error(tolerance: float, frame: int) -> float:
        return 1e-4 * tolerance * (100 if 18 < frame < 25 else 1)

    found = search(stage, error, 50.0, monkeypatch)
    assert found.by_frame[21] < found.by_frame[0] / 50
    assert -10 * np.log10(error(found.by_frame[21], 21)) >= 50


def test_what_not_even_every_voxel_reaches(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """One frame that falls short is enough: the whole film is then drawn as well as possible."""
    found = search(stage, lambda tolerance, frame: 1e-3 if frame == 99 else 1e-9, 40.0, monkeypatch)
    assert not found.is_reachable
    assert found.by_frame == dict.fromkeys(FRAMES, 0.0)
    assert (found.worst.frame, found.worst.tolerance, found.worst.value) == (99, 0.0, pytest.approx(30.0))


def test_a_film_of_splats_has_one_tolerance(monkeypatch: pytest.MonkeyPatch) -> None:
    splats = prepare_stage(SPLATS, clock=lambda: 0.0, num_threads=1, any_tolerance=True)
    found = search(splats, lambda tolerance, frame: tolerance * (1 + frame) / 1e6, 45.0, monkeypatch)
    (tolerance,) = {*found.by_frame.values()}
    assert 45 <= -10 * np.log10(tolerance * 100 / 1e6) < 48


def test_a_frame_that_a_finer_tolerance_makes_worse_is_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first frame is good enough from 1 down to 0.2, and again from 0.05 on; the last one from 0.1 on."""
    splats = prepare_stage(SPLATS, clock=lambda: 0.0, num_threads=1, any_tolerance=True)

    def error(tolerance: float, frame: int) -> float:
        is_good = (0.2 < tolerance < 1 or tolerance < 0.05) if frame == 0 else tolerance < 0.1 or frame != 99
        return 1e-6 if is_good else 1e-3

    found = search(splats, error, 45.0, monkeypatch)
    (tolerance,) = {*found.by_frame.values()}
    assert found.is_reachable and 0.04 < tolerance < 0.05


def test_a_margin_for_what_few_rays_say(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    def error(tolerance: float, frame: int) -> float:
        return tolerance * 1e-4

    sure = search(stage, error, 45.0, monkeypatch).by_frame[0]
    monkeypatch.setattr(Exact, "deviation", 0.5)
    assert search(stage, error, 45.0, monkeypatch).by_frame[0] < 0.7 * sure
