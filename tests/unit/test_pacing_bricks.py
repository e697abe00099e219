"""Bricks on a budget of cells, or of time on a machine whose speed is known."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest
from film_stages import INTEGRATED, stage_of

from renderer.costs import CostLog
from renderer.drawing import Stage
from renderer.pacing import Details, Pacer, try_drawings
from renderer.pipeline import render_frames
from renderer.scene import CameraSpec, ErrorSpec, OutputSpec, ProceduralSource, TimeBudget, TurntablePath, VolumeSpec
from tests.support.machines import SimulatedMachine

NUM_FRAMES = 40
WRITING_S = 2e-3


@pytest.fixture(scope="module")
def stage() -> Stage:
    return stage_of(
        replace(
            INTEGRATED,
            volume=VolumeSpec(ProceduralSource("engine_block", (64, 64, 40))),
            camera=CameraSpec(TurntablePath(NUM_FRAMES, start=10.0, elevation=20.0)),
            output=OutputSpec(INTEGRATED.output.file, size=(200, 160)),
            error=ErrorSpec(goal=TimeBudget(((0, 1.0),))),
        )
    )


def film(stage: Stage, machine: SimulatedMachine, seconds: float) -> tuple[list[float], list[float]]:
    """Seconds and tolerances of the frames."""
    details = Details(stage, CostLog())
    try_drawings(details, 0, 0.3 * seconds, machine, clock=machine.clock)
    pacer = Pacer(details, lambda frame: seconds)
    taken, tolerances = [], []
    start = machine.now
    for frame in render_frames(stage, range(NUM_FRAMES), machine, clock=machine.clock, guide=pacer):
        machine.now += WRITING_S
        taken.append(machine.now - start)
        tolerances.append(frame.tolerance)
        start = machine.now
    return taken, tolerances


BUDGETS = (0.014, 0.02, 0.03, 0.05)


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
    assert Details(stage, CostLog()).family.num_cells(tolerances[0]) == 1


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
    details = Details(stage, CostLog())
    try_drawings(details, 0, 0.01, machine, clock=machine.clock)
    pacer = Pacer(details, lambda frame: 0.04)
    predicted, taken, start = [], [], machine.now
    for frame in render_frames(stage, range(20), machine, clock=machine.clock, guide=pacer):
        machine.now += WRITING_S
        predicted.append(frame.predicted_seconds)
        taken.append(machine.now - start)
        start = machine.now
    assert predicted[5:] == pytest.approx(taken[5:], rel=0.03)
