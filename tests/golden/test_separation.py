"""Harmless changes pass and every defect is found at `same-machine`, on small frames of splats and of bricks.

docs/benchmarks/goldens.md has more.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from defects import DEFECTS, SEEN_LEVELS, Defect
from harmless import HARMLESS, Harmless
from subjects import BRICKS, SPLATS, Pixels, Shot

from renderer.draw import CPURasterizer, GLRasterizer
from renderer.study import STRICTNESSES, FrameDifference, exceeded_limits

SHOTS = {"splats": ("coarse",), "bricks": ("bricks_coarse", "bricks_transparent")}

# Defects that these frames cannot have.
ABSENT = {
    "splats": {
        "gaps of 0.1 voxel between bricks",
        "steps twice as long",
        "pixels interpolated that differ",
        "rays that end at a transmittance of 10 %",
        "alpha lost",
        "premultiplied for straight alpha",
    },
    "bricks": {
        "one level of cells missing",
        "8 x 8 x 8 voxels missing",
        "no opacity correction in one level",
        "footprints 1 % wider",
        "footprints that end in a step",
    },
}

# Defects that move no pixel by two steps, as rounding does, too: only the number of pixels shows them.
FAINT_EVERYWHERE = {"rounded down", "background one step brighter", "noise cluster: 1 step in 8 x 8 px"}
FAINT = {"splats": {*FAINT_EVERYWHERE, "optical depths 1 % too large"}, "bricks": FAINT_EVERYWHERE}

# Defects that another driver may cause, too, on one of the frames at least.
UNSEEN_ACROSS_DRIVERS = {
    "splats": {
        "one splat or brick missing",
        "two overlapping ones swapped",
        "footprints 1 % wider",
        "footprints that end in a step",
        "one pixel off by 3 steps",
    },
    "bricks": {"one pixel off by 3 steps"},
}

each_primitive = pytest.mark.parametrize("primitive", SHOTS)


@pytest.fixture(scope="module")
def shots(rasterizer: GLRasterizer) -> Iterator[dict[str, list[Shot]]]:
    """Yield the frames of each primitive."""
    with CPURasterizer() as cpu:
        subjects = {subject.name: subject for subject in (*SPLATS, *BRICKS)}
        yield {
            primitive: [Shot(subjects[name], rasterizer, cpu) for name in names] for primitive, names in SHOTS.items()
        }


def exceeded(shot: Shot, picture: Pixels) -> dict[str, list[str]]:
    """Return the metrics over their limits, by the strictness."""
    limits = {name: level.limits for name, level in STRICTNESSES.items()}
    figures = FrameDifference(shot.golden, picture).metrics({name for each in limits.values() for name in each})
    return {name: exceeded_limits(figures, each) for name, each in limits.items()}


@each_primitive
@pytest.mark.parametrize("defect", DEFECTS, ids=str)
def test_every_defect_is_found_on_the_same_machine(
    defect: Defect, primitive: str, shots: dict[str, list[Shot]]
) -> None:
    drawn = [(shot, defect.inject(shot)) for shot in shots[primitive]]
    pictures = [(shot, picture) for shot, picture in drawn if picture is not None]
    assert bool(pictures) == (defect.name not in ABSENT[primitive])
    if not pictures:
        return
    moved = max(FrameDifference(shot.golden, picture).largest() for shot, picture in pictures)
    assert moved > 0
    assert (moved < SEEN_LEVELS) == (defect.name in FAINT[primitive])
    found = [exceeded(shot, picture) for shot, picture in pictures]
    assert all(levels["same-machine"] for levels in found)
    assert all(levels["cross-driver"] for levels in found) == (defect.name not in UNSEEN_ACROSS_DRIVERS[primitive])


@each_primitive
@pytest.mark.parametrize("change", [each for each in HARMLESS if "reference" not in each.name], ids=str)
def test_harmless_changes_pass(change: Harmless, primitive: str, shots: dict[str, list[Shot]]) -> None:
    pictures = [(shot, change.make(shot)) for shot in shots[primitive]]
    levels = list(STRICTNESSES)
    found = [exceeded(shot, picture) for shot, picture in pictures if picture is not None]
    assert found
    for level in levels[levels.index(change.level) :]:
        assert [each[level] for each in found] == [[]] * len(found)


def test_changes_have_names_of_their_own() -> None:
    names = [*(defect.name for defect in DEFECTS), *(change.name for change in HARMLESS)]
    assert len(set(names)) == len(names)
    for expected in (ABSENT, FAINT, UNSEEN_ACROSS_DRIVERS):
        assert set(names) >= {name for of_primitive in expected.values() for name in of_primitive}
