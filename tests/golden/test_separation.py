"""Harmless changes pass and every defect is found at `same-machine`, on small frames of splats and of bricks.

docs/benchmarks/goldens.md says what more frames show.
"""

from __future__ import annotations

import pytest
from defects import DEFECTS
from harmless import HARMLESS
from measured import Measured, measured
from subjects import BRICKS, SPLATS, Change, Shot

from hsplat_cli.compare import STRICTNESSES
from renderer.draw import BrickRasterizer, SplatRasterizer

SHOTS = {"splats": ("coarse",), "bricks": ("bricks_coarse", "bricks_transparent")}

# Defects that these frames cannot have.
ABSENT = {
    "splats": {"gaps of 0.1 voxel between bricks", "steps twice as long", "pixels interpolated that differ",
        "rays that end at a transmittance of 10 %", "one ray in every pixel", "at most four rays in a pixel",
        "alpha lost", "premultiplied for straight alpha"},
    "bricks": {"one level of cells missing", "8 x 8 x 8 voxels missing", "no opacity correction in one level",
        "footprints 1 % wider", "footprints that end in a step"},
}  # fmt: skip

# Defects that move no pixel by two steps, as rounding does, too: only the number of pixels shows them.
FAINT_EVERYWHERE = {"rounded down", "background one step brighter", "noise cluster: 1 step in 8 x 8 px"}
FAINT = {"splats": {*FAINT_EVERYWHERE, "optical depths 1 % too large"}, "bricks": FAINT_EVERYWHERE}

# Defects that another driver may cause, too, on one of the frames at least.
UNSEEN_ACROSS_DRIVERS = {
    "splats": {"one splat or brick missing", "two overlapping ones swapped", "footprints 1 % wider",
        "footprints that end in a step", "one pixel off by 3 steps"},
    "bricks": {"one pixel off by 3 steps", "tolerance 10 % coarser"},
}  # fmt: skip

each_primitive = pytest.mark.parametrize("primitive", SHOTS)


@pytest.fixture(scope="module")
def shots(rasterizer: SplatRasterizer, brick_rasterizer: BrickRasterizer) -> dict[str, list[Shot]]:
    """Return the frames of each primitive."""
    subjects = {subject.name: subject for subject in (*SPLATS, *BRICKS)}
    return {
        primitive: [Shot(subjects[name], rasterizer, brick_rasterizer) for name in names]
        for primitive, names in SHOTS.items()
    }


def rows_of(change: Change, shots: list[Shot]) -> list[Measured]:
    return [row for shot in shots if (row := measured(shot, change)) is not None]


@each_primitive
@pytest.mark.parametrize("defect", DEFECTS, ids=str)
def test_every_defect_is_found_on_the_same_machine(
    defect: Change, primitive: str, shots: dict[str, list[Shot]]
) -> None:
    rows = rows_of(defect, shots[primitive])
    assert bool(rows) == (defect.name not in ABSENT[primitive])
    if not rows:
        return
    assert any(row.is_seen for row in rows) == (defect.name not in FAINT[primitive])
    assert all(row.over("same-machine") for row in rows)
    assert all(row.over("cross-driver") for row in rows) == (defect.name not in UNSEEN_ACROSS_DRIVERS[primitive])


@each_primitive
@pytest.mark.parametrize("change", [each for each in HARMLESS if "reference" not in each.name], ids=str)
def test_harmless_changes_pass(change: Change, primitive: str, shots: dict[str, list[Shot]]) -> None:
    rows, levels = rows_of(change, shots[primitive]), list(STRICTNESSES)
    assert rows
    for level in levels[levels.index(change.level) :]:
        assert [row.over(level) for row in rows] == [[]] * len(rows)


def test_changes_have_names_of_their_own() -> None:
    names = [*(defect.name for defect in DEFECTS), *(change.name for change in HARMLESS)]
    assert len(set(names)) == len(names)
    for expected in (ABSENT, FAINT, UNSEEN_ACROSS_DRIVERS):
        assert set(names) >= {name for of_primitive in expected.values() for name in of_primitive}
