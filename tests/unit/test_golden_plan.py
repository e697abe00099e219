"""The plan of an update of goldens: which frames change and how much, which are removed, which stay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hsplat_cli.compare import (
    Golden,
    GoldenOptions,
    GoldenOrigin,
    GoldenUpdate,
    GoldenVolume,
    Provenance,
    describe_update,
    plan_update,
)
from renderer.film import Pixels, bytes_digest, encode_png, file_digest

DIGEST = "0" * 32
ORIGIN = GoldenOrigin(GoldenVolume("a", DIGEST, (4, 4, 4), "uint8"), "x", {"tolerance": 0.1}, {})
GREY: Pixels = np.full((16, 20, 3), 100, np.uint8)


def names_of(frames: range) -> dict[int, str]:
    return {frame: f"frame-{frame:04}.png" for frame in frames}


def lighter(*levels: int) -> Pixels:
    """Return GREY with a pixel that is lighter by each of these."""
    image = GREY.copy()
    for column, level in enumerate(levels):
        image[3, column] += np.uint8(level)
    return image


class Desk:
    """A folder of goldens, all GREY, and rendered pictures."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.before = folder / "goldens", Provenance(**vars(ORIGIN), frames=())
        self._drawn = folder / "drawn"
        self.folder.mkdir()
        self._drawn.mkdir()

    def keep(self, *frames: int) -> None:
        goldens = []
        for frame in frames:
            content = encode_png(GREY)
            (self.folder / f"frame-{frame:04}.png").write_bytes(content)
            goldens.append(Golden(frame, f"frame-{frame:04}.png", bytes_digest(content)))
        self.before = replace(self.before, frames=tuple(goldens))

    def plan(self, *pictures: Pixels, tolerance: float = 0.1) -> GoldenUpdate:
        """Plan to give the folder these pictures, of frames from 0 on."""
        names = names_of(range(len(pictures)))
        for frame, picture in enumerate(pictures):
            (self._drawn / f"{frame}.png").write_bytes(encode_png(picture))
        files = {frame: self._drawn / f"{frame}.png" for frame in names}
        before = self.before if self.before.frames else None
        return plan_update(
            GoldenOptions(self.folder), before, names, files, replace(ORIGIN, scene={"tolerance": tolerance})
        )


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path)


def test_changes_are_listed_worst_first(desk: Desk) -> None:
    desk.keep(0, 1, 2, 3)
    plan = desk.plan(lighter(1), GREY, lighter(9), lighter(9, 9))
    assert [change.name for change in plan.changes] == ["frame-0003.png", "frame-0002.png", "frame-0000.png"]
    assert [change.figures["largest"] for change in plan.changes] == [9, 9, 1]
    kept = [ours == theirs for ours, theirs in zip(plan.after.frames, desk.before.frames, strict=True)]
    assert kept == [False, True, False, False]


def test_other_bytes_of_equal_pixels_are_kept_and_listed(desk: Desk) -> None:
    desk.keep(0)
    desk.before = replace(desk.before, frames=(replace(desk.before.frames[0], digest=DIGEST),))
    plan = desk.plan(GREY)
    assert plan.changes_anything and plan.changes == []
    assert list(describe_update(plan)) == [
        "no pixel of 1 frame changes",
        "golden.json changes: the files differ from those it lists",
    ]
    assert plan.after.frames == (Golden(0, "frame-0000.png", file_digest(desk.folder / "frame-0000.png")),)


def test_another_driver_or_version_alone_is_no_change(desk: Desk) -> None:
    desk.keep(0)
    desk.before = replace(desk.before, device="y", versions={"numpy": "1"})
    assert not desk.plan(GREY).changes_anything
    plan = desk.plan(lighter(1))
    assert plan.changes_anything
    assert replace(plan.after, frames=()) == Provenance(**vars(ORIGIN), frames=())


def test_another_scene_of_equal_pixels_is_a_change(desk: Desk) -> None:
    desk.keep(0)
    plan = desk.plan(GREY, tolerance=0.2)
    assert plan.changes_anything and plan.changes == []
    assert plan.after.scene == {"tolerance": 0.2}


def test_an_unrequested_golden_without_a_file_is_no_longer_listed(desk: Desk) -> None:
    desk.keep(0, 5)
    (desk.folder / "frame-0005.png").unlink()
    plan = desk.plan(GREY)
    assert plan.changes_anything
    assert [golden.frame for golden in plan.after.frames] == [0]


def test_frames_that_cannot_be_compared_are_listed_first(desk: Desk) -> None:
    desk.keep(0, 1, 2, 3, 4)
    (desk.folder / "frame-0001.png").unlink()
    (desk.folder / "frame-0002.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    (desk.folder / "frame-0003.png").write_bytes(encode_png(np.zeros((8, 8, 4), np.uint8)))
    plan = desk.plan(lighter(200), GREY, GREY, GREY, GREY, GREY)
    assert [(change.name[6:10], not change.figures) for change in plan.changes] == [
        ("0001", True), ("0002", True), ("0003", True), ("0005", True), ("0000", False)
    ]  # fmt: skip


def test_changes_of_invisible_colours_are_explained(desk: Desk) -> None:
    desk.keep(0, 1)
    clear = np.zeros((16, 20, 4), np.uint8)
    (desk.folder / "frame-0001.png").write_bytes(encode_png(clear))
    lines = list(describe_update(desk.plan(lighter(1), clear + np.uint8([7, 7, 7, 0]))))
    assert [line.split()[:2] for line in lines[2:4]] == [["frame-0000.png", "1"], ["frame-0001.png", "0"]]
    assert lines[4] == "  0 everywhere: only colours at an alpha of 0 differ"


def test_of_many_changes_the_worst_are_listed(desk: Desk) -> None:
    desk.keep(*range(30))
    lines = list(describe_update(desk.plan(*(lighter(level) for level in range(30)))))
    assert lines[0] == "29 of 30 frames change:"
    assert [line.split()[1] for line in lines[2:22]] == [str(level) for level in range(29, 9, -1)]
    assert lines[22] == "  and 9 more, none of which changes more"
