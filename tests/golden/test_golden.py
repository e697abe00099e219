"""Golden frames: what `hsplat render` draws looks as it did when somebody last looked.

The frames were made by Mesa's llvmpipe. With one version of it they come out the same bytes; processors with other
vector instructions, and other versions, make differences that LARGEST and DENSEST allow.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import numpy.typing as npt
import pytest
from golden_cases import CASES, FOLDER, FRAMES, Case
from golden_compare import AMPLIFICATION, Difference, compare, read_frame, write_difference

from renderer import drawing
from renderer.splats import SplatBatch

FAILED = FOLDER / "failed"


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_golden(case: Case, tmp_path: Path) -> None:
    drawn = case.draw(tmp_path)
    assert {path.name for path in drawn} == {path.name for path in FRAMES.glob(f"{case.name}-*.png")}, (
        "the golden frames are others; if that is meant: python tests/golden/regenerate.py " + case.name
    )
    complaints = [text for path in drawn if (text := mismatch(FRAMES / path.name, path, FAILED))]
    if complaints:
        device = json.loads(next(tmp_path.glob("*.json")).read_text(encoding="utf-8"))["gl"]
        pytest.fail("\n".join([f"{case.name} protects {case.protects}; drawn by {device}", *complaints]))


def mismatch(golden_path: Path, actual_path: Path, folder: Path) -> str | None:
    """What is different, once pictures of it lie in `folder`, or None."""
    golden, actual = read_frame(golden_path), read_frame(actual_path)
    if golden.shape != actual.shape:
        return f"{golden_path.name}: {actual.shape}, not {golden.shape}"
    difference = compare(golden, actual)
    if not difference.is_visible:
        return None
    write_difference(folder, golden_path.stem, golden, actual)
    return f"{golden_path.name}: {difference}\n  {folder}/{golden_path.stem}-*.png show it, amplified {AMPLIFICATION} x"


def test_every_frame_belongs_to_a_case() -> None:
    assert {path.stem.rpartition("-")[0] for path in FRAMES.iterdir()} == {case.name for case in CASES}


def test_every_case_looks_different_from_all_others() -> None:
    """One that looks like another protects nothing of its own."""
    frames = {path.name: read_frame(path) for path in sorted(FRAMES.glob("*.png"))}
    same = [
        (first, second)
        for first, second in itertools.combinations(frames, 2)
        if frames[first].shape == frames[second].shape and not compare(frames[first], frames[second]).is_visible
    ]
    assert same == []


# That the comparison finds what it is for: the renderer is spoilt, and the frame has to be found different.


def _red_too_strong(splats: SplatBatch) -> SplatBatch:
    vertices = splats.vertices.copy()
    vertices[:, 3] *= np.float32(1.01)
    return dataclasses.replace(splats, vertices=vertices)


def _moved(splats: SplatBatch) -> SplatBatch:
    """A sixth of a voxel to one side."""
    return dataclasses.replace(splats, origin=splats.origin + np.array([0.17, 0, 0]))


def _narrower(splats: SplatBatch) -> SplatBatch:
    return dataclasses.replace(splats, axes=splats.axes * 0.98)


@pytest.mark.parametrize("defect", [_red_too_strong, _moved, _narrower])
def test_a_defect_is_found(
    defect: Callable[[SplatBatch], SplatBatch], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_splats = drawing.make_splats
    monkeypatch.setattr(drawing, "make_splats", lambda cut, spec: defect(make_splats(cut, spec)))
    case = CASES[0]
    texts = [mismatch(FRAMES / path.name, path, tmp_path / "failed") for path in case.draw(tmp_path)]
    assert all(texts)


def _without_one(order: npt.NDArray[np.uint32], splats: SplatBatch) -> npt.NDArray[np.uint32]:
    """The densest splat of the nearest tenth is lost."""
    near = len(order) * 9 // 10
    return np.delete(order, near + np.argmax(splats.areas[order[near:], 3]))


def _front_to_back(order: npt.NDArray[np.uint32], splats: SplatBatch) -> npt.NDArray[np.uint32]:
    return np.ascontiguousarray(order[::-1])


@pytest.mark.parametrize("defect", [_without_one, _front_to_back])
def test_a_defect_of_the_order_is_found(
    defect: Callable[[npt.NDArray[np.uint32], SplatBatch], npt.NDArray[np.uint32]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    visible_orders = drawing.visible_orders

    def spoilt(splats: SplatBatch, *rest: Any) -> list[tuple[float, npt.NDArray[np.uint32]]]:
        return [(share, defect(order, splats)) for share, order in visible_orders(splats, *rest)]

    monkeypatch.setattr(drawing, "visible_orders", spoilt)
    assert all(mismatch(FRAMES / path.name, path, tmp_path / "failed") for path in CASES[0].draw(tmp_path))


def test_pictures_of_a_mismatch(tmp_path: Path) -> None:
    golden = FRAMES / "transparent-0.png"
    spoilt = read_frame(golden).copy()
    spoilt[40:44, 50:54, 0] = np.where(spoilt[40:44, 50:54, 0] > 100, 0, 255)
    actual = tmp_path / golden.name
    imageio.imwrite(actual, spoilt)
    text = mismatch(golden, actual, tmp_path / "failed")
    assert text is not None
    assert text.startswith("transparent-0.png: largest difference ")
    assert f"{tmp_path}/failed/transparent-0-*.png show it, amplified 20 x" in text
    assert {path.name for path in (tmp_path / "failed").iterdir()} == {
        f"transparent-0-{kind}.png" for kind in ("golden", "actual", "difference", "amplified")
    }
    amplified = read_frame(tmp_path / "failed" / "transparent-0-amplified.png")
    assert np.count_nonzero(amplified) == 16


def test_small_differences_far_apart_are_allowed_and_close_together_are_not() -> None:
    golden = np.full((32, 32, 3), 100, np.uint8)
    scattered, close = golden.copy(), golden.copy()
    scattered[::8, ::8] += 3
    close[8:16, 8:16, 1] += 1
    assert compare(golden, scattered) == Difference(3, pytest.approx(3 / 64))
    assert not compare(golden, scattered).is_visible
    assert compare(golden, close) == Difference(1, pytest.approx(1 / 3))
    assert compare(golden, close).is_visible
    scattered[5, 5, 0] += 4
    assert compare(golden, scattered).is_visible
