"""Bricks on a budget of cells, or of time on a machine whose speed is known."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest
from film_stages import PLAIN, stage_of

from renderer.frame import BudgetController, LODCostEstimator, Stage, calibrate_costs, render_frames
from renderer.scene import CameraSpec, ErrorSpec, OutputSpec, ProceduralSource, TimeBudget, TurntablePath, VolumeSpec
from tests.support.machines import BringingMachine, SimulatedMachine

NUM_FRAMES = 40
WRITING_S = 2e-3


@pytest.fixture(scope="module")
def stage() -> Stage:
    return stage_of(
        replace(
            PLAIN,
            volume=VolumeSpec(ProceduralSource("engine_block", (64, 64, 40))),
            camera=CameraSpec(TurntablePath(NUM_FRAMES, start=10.0, elevation=20.0)),
            output=OutputSpec(PLAIN.output.file, size=(200, 160)),
            error=ErrorSpec(goal=TimeBudget(((0, 1.0),))),
        )
    )


def film(stage: Stage, machine: SimulatedMachine, seconds: float) -> tuple[list[float], list[float]]:
    """Seconds and tolerances of the frames."""
    estimator = LODCostEstimator(stage)
    calibrate_costs(estimator, 0, 0.3 * seconds, machine, clock=machine.clock)
    controller = BudgetController(estimator, lambda frame: seconds)
    taken, tolerances = [], []
    start = machine.now
    for frame in render_frames(stage, range(NUM_FRAMES), machine, clock=machine.clock, controller=controller):
        machine.now += WRITING_S
        taken.append(machine.now - start)
        tolerances.append(frame.tolerance)
        start = machine.now
    return taken, tolerances


BUDGETS = (0.016, 0.02, 0.03, 0.05)


@pytest.mark.parametrize("seconds", BUDGETS)
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_frames_take_the_time_that_they_have(stage: Stage, seconds: float, noise: float) -> None:
    taken, tolerances = film(stage, SimulatedMachine(noise=noise), seconds)
    in_time = [abs(t / seconds - 1) <= 0.2 for t in taken[5:]]
    assert sum(in_time) / len(in_time) >= 0.9
    assert min(tolerances) > 0


@pytest.mark.parametrize("seconds", BUDGETS)
def test_one_cut_for_a_film_on_a_steady_machine(stage: Stage, seconds: float) -> None:
    _, tolerances = film(stage, SimulatedMachine(), seconds)
    assert len(set(tolerances)) == 1


def test_more_time_is_a_smaller_tolerance(stage: Stage) -> None:
    """Also where every brick has voxels for cells already: steps become shorter."""
    chosen = [film(stage, SimulatedMachine(), seconds)[1][-1] for seconds in BUDGETS]
    assert all(more < less for less, more in pairwise(chosen))


def test_time_to_spare_is_for_the_finest_detail(stage: Stage) -> None:
    _, tolerances = film(stage, SimulatedMachine(), 5.0)
    assert set(tolerances) == {0.0}


def test_a_budget_below_any_frame_draws_the_quickest_cut(stage: Stage) -> None:
    taken, tolerances = film(stage, SimulatedMachine(), 1e-3)
    assert len(set(tolerances)) == 1
    assert min(taken) > 1e-3
    assert LODCostEstimator(stage).primitive.num_cells(tolerances[0]) == 1


@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("seconds", [0.02, 0.03])
def test_a_machine_that_changes_its_speed_is_followed_within_some_frames(
    stage: Stage, seconds: float, factor: float
) -> None:
    def pace(number: int) -> float:
        return factor if number > NUM_FRAMES // 2 else 1.0

    taken, _ = film(stage, SimulatedMachine(pace=pace), seconds)
    assert all(abs(t / seconds - 1) <= 0.2 for t in taken[NUM_FRAMES // 2 + 6 :])


def test_predictions_hold_for_a_film(stage: Stage) -> None:
    """Of a machine whose costs are the samples."""
    machine = SimulatedMachine()
    estimator = LODCostEstimator(stage)
    calibrate_costs(estimator, 0, 0.01, machine, clock=machine.clock)
    controller = BudgetController(estimator, lambda frame: 0.04)
    predicted, taken, start = [], [], machine.now
    for frame in render_frames(stage, range(20), machine, clock=machine.clock, controller=controller):
        machine.now += WRITING_S
        predicted.append(frame.predicted_seconds)
        taken.append(machine.now - start)
        start = machine.now
    assert predicted[5:] == pytest.approx(taken[5:], rel=0.03)


@pytest.mark.parametrize("seconds", BUDGETS)
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_what_a_frame_does_for_the_others_is_not_taken_for_the_speed(
    stage: Stage, seconds: float, noise: float
) -> None:
    """Bricks go to the device once: what is drawn is as fine as if they had been there, whenever the detail changes."""
    _, needed = film(stage, SimulatedMachine(), seconds)
    _, tolerances = film(stage, BringingMachine(noise=noise), seconds)
    assert max(tolerances) <= 2 * needed[-1]


@pytest.mark.parametrize("seconds", [0.02, 0.03])
@pytest.mark.parametrize("factor", [0.5, 2.0, 3.0])
def test_nor_on_a_machine_that_changes_its_speed(stage: Stage, seconds: float, factor: float) -> None:
    def pace(number: int) -> float:
        return factor if number > NUM_FRAMES // 2 else 1.0

    before = film(stage, SimulatedMachine(), seconds)[1][-1]
    after = film(stage, SimulatedMachine(pace=lambda number: factor), seconds)[1][-1]
    taken, tolerances = film(stage, BringingMachine(pace=pace), seconds)
    assert max(tolerances) <= 2 * max(before, after)
    assert sum(abs(t / seconds - 1) <= 0.2 for t in taken[NUM_FRAMES // 2 :]) >= 14


@pytest.mark.parametrize("seconds", [0.02, 0.03])
def test_frames_that_all_bring_something_are_learnt_from(stage: Stage, seconds: float) -> None:
    """A camera among the bricks sees others in each frame."""

    class Passing(SimulatedMachine):
        def upload(self, batch: object, order: object, view: object) -> bool:
            self.now += seconds / 4
            return True

    taken, _ = film(stage, Passing(), seconds)
    assert all(abs(t / seconds - 1) <= 0.2 for t in taken[10:])


def test_what_a_frame_took_is_told(stage: Stage) -> None:
    """With what it did for the others, in a step of its own."""
    machine = BringingMachine()
    estimator = LODCostEstimator(stage)
    calibrate_costs(estimator, 0, 0.01, machine, clock=machine.clock)
    start = machine.now
    first, second = render_frames(
        stage, range(2), machine, clock=machine.clock, controller=BudgetController(estimator, lambda frame: 0.03)
    )
    assert sum(first.seconds.values()) + sum(second.seconds.values()) == pytest.approx(machine.now - start)
    assert first.seconds["bricks"] == pytest.approx(10 * first.seconds["draw"])
    assert "bricks" not in second.seconds


def test_a_detail_that_is_far_too_quick_is_given_up_at_once(stage: Stage) -> None:
    """The machine was slow for a while, and its last frames still say so."""
    machine = SimulatedMachine(pace=lambda number: 8.0 if 14 <= number < 24 else 1.0)
    taken, _ = film(stage, machine, 0.03)
    quick = [t for t in taken if t < 0.4 * 0.03]
    assert 1 <= len(quick) <= 2


def test_near_the_time_one_goes_in_small_steps(stage: Stage) -> None:
    """Of a quarter more time tolerances change by a factor of 2; of three times the time far more, at once."""
    for factor, most in ((1.25, 2.1), (3.0, 16.5)):
        machine = SimulatedMachine(pace=lambda number, factor=factor: factor if number > 15 else 1.0)  # type: ignore[misc]
        _, tolerances = film(stage, machine, 0.03)
        steps = [max(a, b) / min(a, b) for a, b in pairwise(tolerances)]
        assert most / 1.5 < max(steps) <= most
