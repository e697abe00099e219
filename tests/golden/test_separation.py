"""Harmless changes pass and every defect is found at `same-machine`, on two small frames.

docs/benchmarks/goldens.md has more.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from defects import DEFECTS, SEEN_LEVELS, Defect
from harmless import HARMLESS, Harmless
from subjects import SUBJECTS, Pixels, Shot

from renderer.draw import GLRasterizer
from renderer.study import STRICTNESS_LEVELS, FrameDifference, exceeded_limits

SHOTS = ("coarse", "transparent")

# Moved by less than two levels, and so what another rounding may do to a pixel: only their number tells.
FAINT = {
    "optical depths 1 % too large",
    "rounded down",
    "background one level brighter",
    "noise cluster: 1 level in 8 x 8 px",
}

# What another driver may do, too, on one of the two frames at least.
UNSEEN_ACROSS_DRIVERS = {
    "one splat missing",
    "two overlapping splats swapped",
    "footprints 1 % wider",
    "footprints that end in a step",
    "one pixel off by 3 levels",
}


@pytest.fixture(scope="module")
def shots(rasterizer: GLRasterizer) -> list[Shot]:
    return [Shot(subject, rasterizer) for subject in SUBJECTS if subject.name in SHOTS]


def over(shot: Shot, picture: Pixels, level: str) -> list[str]:
    limits = STRICTNESS_LEVELS[level].limits
    return exceeded_limits(FrameDifference(shot.golden, picture).metrics(limits), limits)


def spoilt(defect: Defect, shots: list[Shot]) -> Iterator[tuple[Shot, Pixels]]:
    for shot in shots:
        picture = defect.inject(shot)
        if picture is not None:
            yield shot, picture


@pytest.mark.parametrize("defect", DEFECTS, ids=str)
def test_every_defect_is_found_on_the_same_machine(defect: Defect, shots: list[Shot]) -> None:
    pictures = list(spoilt(defect, shots))
    assert pictures, "nothing was spoilt"
    moved = [FrameDifference(shot.golden, picture).largest() for shot, picture in pictures]
    if defect.name in FAINT:
        assert 0 < max(moved) < SEEN_LEVELS
    else:
        assert max(moved) >= SEEN_LEVELS
    assert all(over(shot, picture, "same-machine") for shot, picture in pictures)
    unseen = any(not over(shot, picture, "cross-driver") for shot, picture in pictures)
    assert unseen == (defect.name in UNSEEN_ACROSS_DRIVERS)


@pytest.mark.parametrize("change", HARMLESS, ids=str)
def test_what_must_pass_does(change: Harmless, shots: list[Shot]) -> None:
    levels = list(STRICTNESS_LEVELS)
    for shot in shots[:1] if "reference" in change.name else shots:  # it takes its time
        picture = change.make(shot)
        assert picture is not None
        for level in levels[levels.index(change.level) :]:
            assert over(shot, picture, level) == []


def test_defects_do_not_share_a_name() -> None:
    names = [*(defect.name for defect in DEFECTS), *(change.name for change in HARMLESS)]
    assert len(set(names)) == len(names)
    assert {defect.name for defect in DEFECTS} >= FAINT | UNSEEN_ACROSS_DRIVERS
