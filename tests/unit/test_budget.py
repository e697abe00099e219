"""Films on a budget of time, on machines whose speed is known."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

import pytest

from renderer.frame import (
    BudgetController,
    LODCostEstimator,
    Stage,
    Stopwatch,
    calibrate_costs,
    prepare_stage,
    render_frames,
)
from renderer.scene import (
    CameraSpec,
    ControlPoint,
    ErrorSpec,
    OutputSpec,
    ProceduralSource,
    Scene,
    SplatSpec,
    TimeBudget,
    TransferSpec,
    TurntablePath,
    VolumeSpec,
)
from tests.support.machines import SimulatedMachine

NUM_FRAMES = 60


@pytest.fixture(scope="module")
def stage() -> Stage:
    points = ControlPoint(50.0, (0.0, 0.0, 0.0), 0.0), ControlPoint(255.0, (1.0, 1.0, 1.0), 0.6)
    scene = Scene(
        volume=VolumeSpec(ProceduralSource("engine_block", (64, 64, 40))),
        transfer_function=TransferSpec(points, 1.0),
        camera=CameraSpec(TurntablePath(NUM_FRAMES, start=10.0, elevation=20.0)),
        output=OutputSpec(Path("unused.mp4"), size=(200, 160)),
        error=ErrorSpec(goal=TimeBudget(((0, 1.0),))),
        splat=SplatSpec("gaussian"),
    )
    return prepare_stage(scene, clock=lambda: 0.0, num_threads=1)


def film(
    stage: Stage, machine: SimulatedMachine, seconds_of: Callable[[int], float], writing: float = 2e-3
) -> tuple[list[float], list[float], list[int]]:
    """Seconds, tolerances and cells of the frames."""
    estimator = LODCostEstimator(stage)
    calibrate_costs(estimator, 0, 0.3 * seconds_of(0), machine, clock=machine.clock)
    controller = BudgetController(estimator, seconds_of)
    taken, tolerances, cells = [], [], []
    start = machine.now
    for frame in render_frames(stage, range(NUM_FRAMES), machine, clock=machine.clock, controller=controller):
        machine.now += writing
        taken.append(machine.now - start)
        tolerances.append(frame.tolerance)
        cells.append(frame.num_cells)
        start = machine.now
    return taken, tolerances, cells


def share_in_time(taken: Sequence[float], tolerances: Sequence[float], seconds: float) -> float:
    """After the first five frames, of those within 20 % of their time, or quicker at full resolution."""
    later = list(zip(taken, tolerances, strict=True))[5:]
    in_time = [abs(t / seconds - 1) <= 0.2 or (t <= seconds and tolerance == 0) for t, tolerance in later]
    return sum(in_time) / len(in_time)


@pytest.mark.parametrize("seconds", [0.01, 0.015, 0.03, 0.05, 0.5])
@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_frames_take_the_time_that_they_have(stage: Stage, seconds: float, noise: float) -> None:
    """Or show every voxel sooner."""
    taken, tolerances, _ = film(stage, SimulatedMachine(noise=noise), lambda frame: seconds)
    assert share_in_time(taken, tolerances, seconds) >= 0.9


@pytest.mark.parametrize("seconds", [0.01, 0.015, 0.03, 0.05])
def test_one_cut_for_a_film_on_a_steady_machine(stage: Stage, seconds: float) -> None:
    """What changes from frame to frame flickers."""
    _, tolerances, _ = film(stage, SimulatedMachine(), lambda frame: seconds)
    assert len(set(tolerances)) == 1


def test_more_time_is_more_cells(stage: Stage) -> None:
    medians = []
    for seconds in (0.01, 0.015, 0.02, 0.03, 0.05, 0.5):
        _, _, cells = film(stage, SimulatedMachine(), lambda frame, seconds=seconds: seconds)  # type: ignore[misc]
        medians.append(sorted(cells)[NUM_FRAMES // 2])
    assert all(a < b for a, b in pairwise(medians))


def test_time_to_spare_shows_every_voxel(stage: Stage) -> None:
    _, tolerances, _ = film(stage, SimulatedMachine(), lambda frame: 5.0)
    assert set(tolerances) == {0.0}


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_machine_that_changes_its_speed_is_followed_within_some_frames(stage: Stage, factor: float) -> None:
    machine = SimulatedMachine(pace=lambda number: factor if number > NUM_FRAMES // 2 else 1.0)
    taken, _, _ = film(stage, machine, lambda frame: 0.03)
    assert all(abs(t / 0.03 - 1) <= 0.2 for t in taken[NUM_FRAMES // 2 + 6 :])


def test_a_budget_below_any_frame_draws_the_quickest_cut(stage: Stage) -> None:
    taken, _, cells = film(stage, SimulatedMachine(), lambda frame: 1e-3)
    assert set(cells) == {1}
    assert min(taken) > 1e-3


def test_budgets_by_frame_are_kept_each(stage: Stage) -> None:
    """A film may be given more time on its way."""

    def seconds_of(frame: int) -> float:
        return 0.012 if frame < NUM_FRAMES // 2 else 0.04

    taken, _, cells = film(stage, SimulatedMachine(), seconds_of)
    assert all(abs(t / seconds_of(frame) - 1) <= 0.2 for frame, t in enumerate(taken))
    assert cells[0] < cells[-1]


def test_a_prediction_is_of_the_whole_frame(stage: Stage) -> None:
    """From its start until it has been taken care of."""
    machine = SimulatedMachine()
    estimator = LODCostEstimator(stage)
    calibrate_costs(estimator, 0, 0.01, machine, clock=machine.clock)
    controller = BudgetController(estimator, lambda frame: 0.03)
    predicted, taken, start = [], [], machine.now
    for frame in render_frames(stage, range(20), machine, clock=machine.clock, controller=controller):
        machine.now += 5e-3
        predicted.append(frame.predicted_seconds)
        taken.append(machine.now - start)
        start = machine.now
    assert predicted[5:] == pytest.approx(taken[5:], rel=0.03)


@pytest.mark.parametrize("seconds", [0.012, 0.015, 0.03])
def test_a_hiccup_of_the_machine_does_not_empty_the_film(stage: Stage, seconds: float) -> None:
    """Of large cells a little less time is a thousand times fewer: one goes there in steps, and comes back."""
    machine = SimulatedMachine(pace=lambda number: 3.0 if number in (20, 21, 22, 23) else 1.0)
    _, _, cells = film(stage, machine, lambda frame: seconds)
    assert min(cells) >= cells[0] / 5
    assert max(cells) <= cells[0] * 5
    assert cells[-1] >= cells[0] / 2  # any cut that keeps to its time is kept


@pytest.mark.parametrize("seconds", [0.012, 0.015, 0.03])
def test_noise_changes_the_cut_seldom(stage: Stage, seconds: float) -> None:
    _, tolerances, cells = film(stage, SimulatedMachine(noise=0.15), lambda frame: seconds)
    assert sum(a != b for a, b in pairwise(tolerances)) <= 5
    assert max(a / b for a, b in pairwise(cells)) <= 5
    assert max(b / a for a, b in pairwise(cells)) <= 5


def test_a_cut_is_chosen_before_the_first_frame(stage: Stage) -> None:
    """So that a still has its time for itself."""
    machine = SimulatedMachine()
    estimator = LODCostEstimator(stage)
    calibrate_costs(estimator, 7, 0.01, machine, clock=machine.clock)
    controller = BudgetController(estimator, lambda frame: 0.03)
    controller.choose(7, Stopwatch(machine.clock))
    (frame,) = render_frames(stage, [7], machine, clock=machine.clock, controller=controller)
    assert "cut" not in frame.seconds
