"""The error schedule."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from film_stages import PLAIN, scheduled
from hypothesis import given, settings, strategies as st

from renderer.scene import (
    MIN_TOLERANCE,
    CameraSpec,
    ErrorSpec,
    MetricTarget,
    Motion,
    SplatBudget,
    TimeBudget,
    TurntablePath,
    min_tolerance,
    moving,
    parse_scene,
    scene_to_dict,
    tolerance_at,
    value_at,
    with_tolerance,
    with_tolerances,
)

MAX_FRAMES = 1_000_000
BUDGET = ErrorSpec(goal=SplatBudget(1000), finest_level=1)
SCENE = replace(PLAIN, camera=CameraSpec(TurntablePath(MAX_FRAMES)), error=BUDGET)
GOALS = (
    SplatBudget(scheduled((0, 1000), (9, 5))),
    TimeBudget(0.5),
    MetricTarget("psnr", 30),
    MetricTarget("rmse", 0.1),
)

TOLERANCE = st.floats(MIN_TOLERANCE, sys.float_info.max)


def test_one_entry_is_constant() -> None:
    assert [tolerance_at(ErrorSpec(scheduled((30, 0.1))), frame) for frame in (0, 30, 500)] == [0.1, 0.1, 0.1]
    assert tolerance_at(ErrorSpec(0.0), 7) == 0.0


def test_0_is_held_and_left_at_once() -> None:
    tolerance = scheduled((2, 0.0), (5, 0.0), (6, 0.5), (8, 0.5), (9, 0.0))
    assert [value_at(tolerance, frame) for frame in range(12)] == [0, 0, 0, 0, 0, 0, 0.5, 0.5, 0.5, 0, 0, 0]


def test_the_least_tolerance() -> None:
    assert min_tolerance(ErrorSpec(scheduled((0, 0.5), (8, 0.02), (9, 0.1)))) == 0.02
    assert min_tolerance(ErrorSpec(scheduled((0, 0.5), (1, 0.0)))) == 0.0
    assert min_tolerance(ErrorSpec(scheduled((3, 7.0)))) == 7.0


@pytest.mark.parametrize("goal", GOALS, ids=lambda goal: type(goal).__name__)
def test_a_goal_may_come_to_any_tolerance(goal: SplatBudget | TimeBudget | MetricTarget) -> None:
    error = ErrorSpec(goal=goal)
    assert min_tolerance(error) == 0.0
    with pytest.raises(AssertionError, match="to be resolved first"):
        tolerance_at(error, 0)


# From tolerances to a scene

GAPS_AND_TOLERANCES = st.lists(
    st.tuples(
        st.one_of(st.just(1), st.integers(1, 9)),
        st.one_of(st.just(0.0), st.sampled_from([MIN_TOLERANCE, 0.1, 0.5]), TOLERANCE),
    ),
    min_size=1,
    max_size=30,
)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(first=st.integers(0, 5), steps=GAPS_AND_TOLERANCES)
def test_every_frame_has_its_tolerance_in_the_scene_and_in_its_json(first: int, steps: list[tuple[int, float]]) -> None:
    tolerances, frame = {}, first
    for gap, tolerance in steps:
        tolerances[frame] = tolerance
        frame += gap
    scene = with_tolerances(SCENE, tolerances)
    assert {frame: tolerance_at(scene.error, frame) for frame in tolerances} == tolerances
    assert parse_scene(json.loads(json.dumps(scene_to_dict(scene))), base=Path()) == scene
    assert scene.error.goal is None and scene.error.finest_level == 1


def test_equal_tolerances_are_written_once() -> None:
    """Runs of them have an entry at their start, and one for the whole film is a number."""
    assert with_tolerances(SCENE, dict.fromkeys(range(3, 99), 0.1)) == with_tolerance(SCENE, 0.1)
    assert scene_to_dict(with_tolerance(SCENE, 0.1))["error"]["tolerance"] == 0.1
    tolerances = dict.fromkeys(range(40), 0.5) | dict.fromkeys(range(40, 60), 0.1) | {60: 0.0}
    held = moving(Motion((0, 40, 60), (0.5, 0.1, 0.0), "hold", "ratio"))
    assert with_tolerances(SCENE, tolerances).error.tolerance == held


def test_frames_between_those_that_are_drawn_belong_to_the_one_before() -> None:
    error = with_tolerances(SCENE, {0: 0.5, 10: 0.1, 20: 0.2}).error
    assert [tolerance_at(error, frame) for frame in (0, 5, 9, 10, 15, 19, 20, 99)] == [
        0.5, 0.5, 0.5, 0.1, 0.1, 0.1, 0.2, 0.2,
    ]  # fmt: skip
