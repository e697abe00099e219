"""Harmless changes pass and defects are found, on small frames of splats and of bricks.

docs/benchmarks/goldens.md says what more frames show.
"""

from __future__ import annotations

import pytest
from defects import DEFECTS
from harmless import HARMLESS
from measured import Measured, measured
from subjects import BRICKS, SPLATS, Change, Shot

from renderer.draw import BrickRasterizer, SplatRasterizer

SHOTS = {"splats": ("nuclei",), "bricks": ("coarse_nuclei", "clear_heart", "labels", "annotated")}

# Defects that these frames cannot have.
ABSENT = {
    "splats": {
        "gaps of 0.1 voxel between bricks",
        "steps twice as long",
        "pixels interpolated that differ",
        "rays that end at a transmittance of 10 %",
        "antialiasing lost",
        "at most four rays in a pixel",
        "halo off by one cell",
        "a stale brick",
        "a brick at the wrong level",
        "another seed of jitter",
        "labels off by one",
        "annotation off by one pixel",
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

# Defects that move no pixel by two steps, as rounding does, too: only `same bytes` finds them.
FAINT_EVERYWHERE = {
    "rounded down",
    "background one step brighter",
    "noise cluster: 1 step in 8 x 8 px",
}
FAINT = {"splats": {*FAINT_EVERYWHERE, "optical depths 1 % too large"}, "bricks": FAINT_EVERYWHERE}

# Defects that pass at 45 dB on one of the frames at least.
UNSEEN_AT_45 = {
    "splats": {
        *FAINT_EVERYWHERE,
        "two overlapping ones swapped",
        "red 1 % too strong",
        "optical depths 1 % too large",
        "footprints 1 % wider",
        "tolerance 10 % coarser",
        "one pixel off by 3 steps",
        "one pixel off by 8 steps",
    },
    "bricks": {
        *FAINT_EVERYWHERE,
        "red 1 % too strong",
        "optical depths 1 % too large",
        "steps twice as long",
        "at most four rays in a pixel",
        "another seed of jitter",
        "camera off by 0.1 degree",
        "tolerance 10 % coarser",
        "wrong gamma: a power of 2.2 for sRGB's curve",
        "noise cluster: 3 steps in 8 x 8 px",
        "one pixel off by 3 steps",
        "one pixel off by 8 steps",
    },
}

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


@pytest.mark.slow
@each_primitive
@pytest.mark.parametrize("defect", DEFECTS, ids=str)
def test_every_defect_is_found(defect: Change, primitive: str, shots: dict[str, list[Shot]]) -> None:
    rows = rows_of(defect, shots[primitive])
    assert bool(rows) == (defect.name not in ABSENT[primitive])
    if not rows:
        return
    assert not any(row.passes("same bytes") for row in rows)
    assert any(row.is_seen for row in rows) == (defect.name not in FAINT[primitive])
    assert any(row.passes("45 dB") for row in rows) == (defect.name in UNSEEN_AT_45[primitive])


@each_primitive
@pytest.mark.parametrize("change", [each for each in HARMLESS if "reference" not in each.name], ids=str)
def test_harmless_changes_pass(change: Change, primitive: str, shots: dict[str, list[Shot]]) -> None:
    rows = rows_of(change, shots[primitive])
    assert rows
    assert change.limit is not None
    for limit in dict.fromkeys((change.limit, "stated accuracy", "45 dB", "40 dB")):
        assert all(row.passes(limit) for row in rows)


def test_changes_have_names_of_their_own() -> None:
    names = [*(defect.name for defect in DEFECTS), *(change.name for change in HARMLESS)]
    assert len(set(names)) == len(names)
    for expected in (ABSENT, FAINT, UNSEEN_AT_45):
        assert set(names) >= {name for of_primitive in expected.values() for name in of_primitive}
