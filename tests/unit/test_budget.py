"""Films on a budget of time, of splats and of bricks, on machines whose speed is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from film_stages import PLAIN, stage_of
from machines import SimulatedMachine, UploadingMachine

from renderer.frame import BudgetController, LODCostEstimator, Stage, Stopwatch, calibrate_costs, render_frames
from renderer.scene import (
    CameraSpec,
    ErrorSpec,
    OutputSpec,
    ProceduralSource,
    SplatSpec,
    TimeBudget,
    TurntablePath,
    VolumeSpec,
)

NUM_FRAMES, WRITING_S = 50, 2e-3
BUDGETS = {"gaussian": (0.015, 0.03), "integrated": (0.02, 0.03)}
two_budgets = pytest.mark.parametrize(
    ("stage", "seconds"),
    [(footprint, seconds) for footprint, both_seconds in BUDGETS.items() for seconds in both_seconds],
    indirect=["stage"],
)
both = pytest.mark.parametrize("stage", list(BUDGETS), indirect=True)
bricks = pytest.mark.parametrize("stage", ["integrated"], indirect=True)


@pytest.fixture(scope="module")
def stage(request: pytest.FixtureRequest) -> Stage:
    return stage_of(
        replace(
            PLAIN,
            camera=CameraSpec(TurntablePath(NUM_FRAMES, start=10.0, elevation=20.0)),
            output=OutputSpec(PLAIN.output.file, size=(200, 160)),
            error=ErrorSpec(goal=TimeBudget(1.0)),
            splat=SplatSpec(request.param),
        ).with_layers(volume=VolumeSpec(ProceduralSource("engine_block", (64, 64, 40))))
    )


class Film(NamedTuple):
    """Seconds, predicted seconds, tolerances and cells of the frames."""

    taken: list[float]
    predicted: list[float]
    tolerances: list[float]
    cells: list[int]

    def share_in_time(self, seconds: float) -> float:
        """After the first five frames, of those within 20 % of their time, or quicker at full resolution."""
        later = list(zip(self.taken, self.tolerances, strict=True))[5:]
        return np.mean([abs(t / seconds - 1) <= 0.2 or (t <= seconds and tolerance == 0) for t, tolerance in later])


def draw(
    stage: Stage, machine: SimulatedMachine, seconds: float | Callable[[int], float], writing: float = WRITING_S
) -> Film:
    seconds_of = seconds if callable(seconds) else lambda frame: seconds
    estimator = LODCostEstimator(stage)
    calibrate_costs(estimator, 0, 0.3 * seconds_of(0), machine, clock=machine.clock)
    controller = BudgetController(estimator, seconds_of)
    film, start = Film([], [], [], []), machine.now
    for frame in render_frames(stage, range(NUM_FRAMES), machine, clock=machine.clock, controller=controller):
        machine.now += writing
        assert frame.predicted_seconds is not None
        for values, value in zip(
            film, (machine.now - start, frame.predicted_seconds, frame.tolerance, frame.num_cells), strict=True
        ):
            values.append(value)
        start = machine.now
    return film


def changes(values: Sequence[float]) -> list[float]:
    """The factors, above 1, by which values change."""
    return [max(a, b) / min(a, b) for a, b in pairwise(values) if a != b]


def changed_speed(factor: float) -> Callable[[int], float]:
    return lambda number: factor if number > NUM_FRAMES // 2 else 1.0


@two_budgets
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_frames_take_the_time_that_they_have(stage: Stage, seconds: float, noise: float) -> None:
    film = draw(stage, SimulatedMachine(noise=noise), seconds)
    assert film.share_in_time(seconds) >= 0.9
    if noise == 0:  # what changes from frame to frame flickers
        assert len(set(film.tolerances)) == 1
        assert film.predicted[5:] == pytest.approx(film.taken[5:], rel=0.03)


@bricks
def test_the_second_frame_knows_how_long_writing_takes(stage: Stage) -> None:
    """Probes may take longer than the drawing."""
    film = draw(stage, SimulatedMachine(), 0.03, writing=0.015)
    assert film.taken[0] > 1.2 * 0.03
    assert all(abs(taken / 0.03 - 1) <= 0.2 for taken in film.taken[1:])


@both
def test_more_time_gives_more_detail(stage: Stage) -> None:
    films = [draw(stage, SimulatedMachine(), seconds) for seconds in BUDGETS[stage.scene.splat.footprint]]
    assert all(more.tolerances[-1] < less.tolerances[-1] for less, more in pairwise(films))
    assert set(draw(stage, SimulatedMachine(), 5.0).tolerances) == {0.0}


@both
def test_a_budget_below_any_frame_draws_the_quickest_cut(stage: Stage) -> None:
    film = draw(stage, SimulatedMachine(), 1e-3)
    assert set(film.cells) == {1}
    assert min(film.taken) > 1e-3


@two_budgets
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_machine_that_changes_its_speed_is_followed(stage: Stage, seconds: float, factor: float) -> None:
    """At once, or in steps where a little less time is many times fewer cells."""
    taken = draw(stage, SimulatedMachine(pace=changed_speed(factor)), seconds).taken
    num_frames = 22 if (seconds, factor) == (0.015, 2.0) else 11
    assert all(abs(t / seconds - 1) <= 0.2 for t in taken[NUM_FRAMES // 2 + num_frames :])


@both
def test_budgets_by_frame_are_kept_each(stage: Stage) -> None:
    """A film may be given more time on its way."""

    def seconds_of(frame: int) -> float:
        return 0.018 if frame < NUM_FRAMES // 2 else 0.04

    film = draw(stage, SimulatedMachine(), seconds_of)
    assert all(abs(t / seconds_of(frame) - 1) <= 0.2 for frame, t in enumerate(film.taken))
    assert film.tolerances[0] > film.tolerances[-1]


@two_budgets
def test_a_hiccup_of_the_machine_changes_nothing(stage: Stage, seconds: float) -> None:
    """Of large cells a little less time is a thousand times fewer."""
    film = draw(stage, SimulatedMachine(pace=lambda number: 3.0 if number in (20, 21, 22, 23) else 1.0), seconds)
    assert len(set(film.tolerances)) == 1


@two_budgets
def test_noise_changes_the_cut_seldom_and_in_small_steps(stage: Stage, seconds: float) -> None:
    film = draw(stage, SimulatedMachine(noise=0.15), seconds)
    assert len(changes(film.tolerances)) <= 5
    assert max(changes(film.cells), default=1.0) <= 5


def test_an_estimator_learns_rates_that_are_not_typical() -> None:
    """Of a machine with dear frames and cheap pixels, the seconds of other sizes are known from its trials."""
    stage_ = stage_of(replace(PLAIN, error=ErrorSpec(goal=TimeBudget(1.0))))
    machine = SimulatedMachine(per_frame=2e-2, per_splat=1e-9, per_pixel=4e-10)
    estimator = LODCostEstimator(stage_)
    calibrate_costs(estimator, 0, 0.1, machine, clock=machine.clock)
    primitive = estimator.primitive
    for size in (3, 100, 1000, 1e5):
        draw_list = estimator.make_draw_list(0, primitive.tolerance_for_size(size), Stopwatch(machine.clock))
        expected = machine.seconds_of(draw_list.lod.batches, draw_list.orders[0][1], draw_list.view)
        assert estimator.predict(draw_list) - WRITING_S == pytest.approx(expected, rel=0.05)


@both
def test_a_cut_is_chosen_before_the_first_frame(stage: Stage) -> None:
    """So that a still has its time for itself."""
    machine = SimulatedMachine()
    estimator = LODCostEstimator(stage)
    calibrate_costs(estimator, 7, 0.01, machine, clock=machine.clock)
    controller = BudgetController(estimator, lambda frame: 0.03)
    controller.choose(7, Stopwatch(machine.clock))
    (frame,) = render_frames(stage, [7], machine, clock=machine.clock, controller=controller)
    assert "cut" not in frame.seconds


# Bricks that are uploaded


@bricks
@pytest.mark.parametrize("seconds", BUDGETS["integrated"])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_uploads_do_not_count_as_drawing(stage: Stage, seconds: float, noise: float) -> None:
    """Bricks go to the device once: the level of detail is as fine as if they had been there."""
    needed = draw(stage, SimulatedMachine(), seconds).tolerances[-1]
    assert max(draw(stage, UploadingMachine(noise=noise), seconds).tolerances) <= 2 * needed


@bricks
@pytest.mark.parametrize("seconds", [0.02, 0.03])
def test_frames_that_all_upload_something_are_learnt_from(stage: Stage, seconds: float) -> None:
    """A camera among the bricks sees others in each frame."""

    class Passing(SimulatedMachine):
        def upload(self, batches: object, orders: object, view: object) -> bool:
            self.now += seconds / 4
            return True

    assert all(abs(t / seconds - 1) <= 0.2 for t in draw(stage, Passing(), seconds).taken[15:])


@bricks
def test_an_upload_is_a_step_of_its_own(stage: Stage) -> None:
    machine = UploadingMachine()
    estimator = LODCostEstimator(stage)
    calibrate_costs(estimator, 0, 0.01, machine, clock=machine.clock)
    start, controller = machine.now, BudgetController(estimator, lambda frame: 0.03)
    first, second = render_frames(stage, range(2), machine, clock=machine.clock, controller=controller)
    assert sum(first.seconds.values()) + sum(second.seconds.values()) == pytest.approx(machine.now - start)
    assert first.seconds["bricks"] == pytest.approx(10 * first.seconds["draw"])
    assert "bricks" not in second.seconds


@bricks
def test_the_film_recovers_after_a_slow_spell(stage: Stage) -> None:
    machine = SimulatedMachine(pace=lambda number: 8.0 if 14 <= number < 24 else 1.0)
    quick = [t for t in draw(stage, machine, 0.03).taken if t < 0.4 * 0.03]
    assert 1 <= len(quick) <= 10


@bricks
@pytest.mark.parametrize(("factor", "most"), [(1.25, 2.1), (3.0, 10.0)])
def test_steps_are_small_near_the_time(stage: Stage, factor: float, most: float) -> None:
    """Where a little time is missing tolerances change by a factor of 2, and where much is missing by far more."""
    film = draw(stage, SimulatedMachine(pace=changed_speed(factor)), 0.03)
    assert most / 1.5 < max(changes(film.tolerances)) <= most
