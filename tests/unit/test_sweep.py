"""Tests of one measured setting, with its timed passes, and of the plan of a sweep."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from film_stages import SPLATS
from machines import Painter

from hsplat_cli.measure import PlannedSetting, measure_setting, plan_sweep
from renderer.accuracy import Truth, measure_accuracy, pool_accuracies, spread_evenly
from renderer.frame import Stage, make_primitive, prepare_stage
from renderer.readers import read_volume
from renderer.scene import CameraSpec, ErrorSpec, MetricTarget, OutputSpec, Scene, SplatSpec, TurntablePath
from renderer.truth import Convergence, PixelMeans
from renderer.view import View
from renderer.volume import Volume

FRAMES = (0, 5)
RMS = ErrorSpec(measure="rms")


@pytest.fixture(scope="module")
def stage() -> Stage:
    camera = CameraSpec(TurntablePath(8, start=10.0, elevation=20.0))
    output = OutputSpec(Path("unused.mp4"), size=(20, 16))
    scene = replace(SPLATS, camera=camera, error=ErrorSpec(), output=output)
    return at_any_tolerance(scene, read_volume(scene.layers[0].volume))


def at_any_tolerance(scene: Scene, volume: Volume) -> Stage:
    return prepare_stage(scene, clock=lambda: 0.0, num_threads=1, volumes=[volume], any_tolerance=True)


def planned(*arguments: Any) -> list[PlannedSetting]:
    """Return the settings of all pyramids."""
    return list(chain.from_iterable(plan_sweep(*arguments)))


class Grey(Painter):
    """Draws a grey that differs between frames, and remembers them."""

    def __init__(self) -> None:
        self.eyes: list[tuple[float, ...]] = []
        super().__init__(self._grey)

    def _grey(self, _: object, view: View) -> tuple[float, ...]:
        self.eyes.append(tuple(view.eye))
        return 0.25, 0.25, 0.25, 1.0 if len(set(self.eyes)) == 1 else 0.5


class Memory:
    """Reports 300 bytes after a reset, then 100 more each time."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        self._bytes = 200

    def peak_bytes(self) -> int:
        self._bytes += 100
        return self._bytes


def truths() -> list[Truth]:
    on_volume = np.zeros((16, 20), bool)
    on_volume[4:12, 5:15] = True
    convergence = Convergence((0.5,), (0.0,), (320,))
    pictures = (np.full((16, 20, 3), 0.25 + frame / 100) for frame in FRAMES)
    means = (PixelMeans(picture, np.zeros_like(picture)) for picture in pictures)
    return [Truth(frame, each, on_volume, convergence) for frame, each in zip(FRAMES, means, strict=True)]


def ticking(seconds: float) -> Callable[[], float]:
    ticks = count()
    return lambda: seconds * next(ticks)


def test_the_first_pass_warms_up_and_yields_the_pictures(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsplat_cli.measure.sweep.PeakMemory", Memory)
    grey = Grey()
    found = measure_setting(stage, truths(), grey, clock=ticking(1e-3), repeats=3)
    assert len(grey.eyes) == 2 * (1 + 3)
    expected = [measure_accuracy(np.full((16, 20, 3), 0.25), truth.picture, truth.on_volume) for truth in truths()]
    assert [sample.accuracy for sample in found.frames] == expected
    assert found.overall == pool_accuracies(expected)
    assert found.peak_bytes == 300
    assert [sample.frame for sample in found.frames] == list(FRAMES)
    for sample in found.frames:
        assert {name: len(times) for name, times in sample.seconds.items()} == {"order": 3, "draw": 3, "quantize": 3}
        assert sample.frame_seconds == pytest.approx([3e-3] * 3)
    assert {name: len(times) for name, times in found.seconds.items()} == {"cut": 3, "primitives": 3}
    assert found.pyramid_seconds == stage.seconds["pyramid"]
    assert found.frame_seconds == pytest.approx(3e-3)
    assert found.num_cells == found.num_primitives == make_primitive(stage).make_lod(0.1, print).num_cells
    assert (found.picture == 64).all() and (found.difference == 0).all()


def test_slow_settings_are_drawn_less_often(stage: Stage) -> None:
    """A pass takes 12 ticks of the clock: 12 seconds are too many, and two passes of 2.4 seconds are over the limit."""
    slow, medium = Grey(), Grey()
    found = measure_setting(stage, truths(), slow, clock=ticking(1.0), repeats=3)
    assert len(slow.eyes) == 3 and slow.eyes[2] == slow.eyes[0]
    assert [len(sample.frame_seconds) for sample in found.frames] == [1, 1]
    measure_setting(stage, truths(), medium, clock=ticking(0.2), repeats=9)
    assert 2 * (1 + 1) < len(medium.eyes) < 2 * (1 + 9)


def test_a_plan_has_all_combinations_from_coarse_to_fine(stage: Stage) -> None:
    prepared: list[str] = []

    def open_stage(scene: Scene) -> AbstractContextManager[Stage]:
        prepared.append(scene.error.measure)
        return nullcontext(at_any_tolerance(scene, stage.layers[0].volume))

    splats = [SplatSpec(), SplatSpec(footprint="gouraud"), SplatSpec(opacity_correction=False)]
    plan = planned(stage.scene, open_stage, [ErrorSpec(), RMS], splats, [0.1, 0.0, 0.5])
    assert prepared == ["optical", "rms"]
    assert [(p.scene.error.measure, p.scene.splat, p.tolerance) for p in plan] == [
        (measure, splat, tolerance) for measure in prepared for splat in splats for tolerance in (0.5, 0.1, 0.0)
    ]
    assert all(
        p.work == make_primitive(stage).make_lod(p.tolerance, print).num_cells
        for p in plan
        if p.scene.error.measure == "optical"
    )
    # At tolerance 0 the six series have two pictures: one for each footprint.
    assert len({p.picture_key() for p in plan}) == 2 * 3 * 2 + 2
    coarse = replace(stage.scene.error, finest_level=1)
    plan_without_voxels = planned(
        replace(stage.scene, error=coarse), lambda _: nullcontext(stage), [coarse], splats[::2], [0.0]
    )
    assert len({p.picture_key() for p in plan_without_voxels}) == 2
    slow, quick = (next(p for p in plan if p.scene.splat == splat and p.tolerance == 0) for splat in splats[1::-1])
    assert slow.predicted_seconds(3, 5) > quick.predicted_seconds(3, 5) > 0


def integrated(stage: Stage) -> Stage:
    return at_any_tolerance(replace(stage.scene, splat=SplatSpec(footprint="integrated")), stage.layers[0].volume)


def test_bricks_have_a_stage_and_tolerances_of_their_own(stage: Stage) -> None:
    prepared: list[tuple[str, str]] = []
    bricks = integrated(stage)

    def open_stage(scene: Scene) -> AbstractContextManager[Stage]:
        prepared.append((scene.error.measure, scene.splat.footprint))
        return nullcontext(bricks if scene.splat.footprint == "integrated" else stage)

    splats = [SplatSpec(), SplatSpec(footprint="integrated"), SplatSpec(opacity_correction=False)]
    plan = planned(stage.scene, open_stage, [ErrorSpec()], splats, None)
    assert prepared == [("optical", "gaussian"), ("optical", "integrated")]
    by_footprint = {
        name: [p.tolerance for p in plan if p.scene.splat.footprint == name] for name in ("gaussian", "integrated")
    }
    assert len(by_footprint["gaussian"]) == 2 * len(set(by_footprint["gaussian"]))
    own = by_footprint["integrated"]
    assert own == sorted(set(own), reverse=True) and own[-1] == 0.0
    assert len(own) > 5 and min(own[:-1]) < 0.1 * min(t for t in by_footprint["gaussian"] if t > 0)
    assert all(p.predicted_seconds(3, 5) > 0 for p in plan)
    measures = planned(stage.scene, lambda _: nullcontext(bricks), [ErrorSpec(), RMS], splats[1:2], [0.0])
    assert len({p.picture_key() for p in measures}) == 2  # steps depend on the measure


def test_chosen_tolerances_include_that_of_the_scene(stage: Stage) -> None:
    """A goal replaces the tolerance, so that the field has only its default."""
    own = ErrorSpec(tolerance=0.123)
    plan = planned(replace(stage.scene, error=own), lambda _: nullcontext(stage), [own, RMS], [SplatSpec()], None)
    tolerances = [p.tolerance for p in plan if p.scene.error.measure == "optical"]
    assert 0.123 in tolerances and 0.0 in tolerances and len(tolerances) <= 11
    assert 0.123 not in [p.tolerance for p in plan if p.scene.error.measure == "rms"]
    goal = replace(own, goal=MetricTarget("psnr", 30.0))
    plan = planned(replace(stage.scene, error=goal), lambda _: nullcontext(stage), [goal], [SplatSpec()], None)
    assert 0.123 not in [p.tolerance for p in plan] and len(plan) > 2
    assert {p.scene.error.goal for p in plan} == {None}


@pytest.mark.parametrize(
    ("frames", "num", "is_loop", "found"),
    [(range(120), 3, True, [0, 40, 80]), (range(121), 3, False, [0, 60, 120]), (range(2), 3, False, [0, 1]),
        (range(1), 3, False, [0]), ([7, 9, 11, 30], 2, True, [7, 11]), ([7, 9, 11, 30], 2, False, [7, 30]),
        ([7, 9, 11, 30], 1, False, [7])],
)  # fmt: skip
def test_frames_are_spread_evenly_over_a_path(
    frames: range | list[int], num: int, is_loop: bool, found: list[int]
) -> None:
    assert spread_evenly(frames, num, is_loop=is_loop) == found
