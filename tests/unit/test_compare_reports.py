"""A comparison as text, JSON and JUnit XML."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from comparing import compare_files, compare_pictures, write_pictures

from hsplat_cli.compare import comparison_table
from renderer.film import Pixels
from renderer.system import printable

LIMITS = {"largest": 1.0, "bias": 0.01}
GREY = np.full((16, 16, 3), 100, np.uint8)


def changed(*steps: int) -> Pixels:
    """Return GREY with one green pixel after the other brighter by these steps."""
    picture = GREY.copy().astype(np.int16)
    picture[0, : len(steps), 1] += np.array(steps, np.int16)
    return picture.astype(np.uint8)


SAME, CLOSE, DIFFERENT = GREY, changed(1), changed(7)
# One picture is the same, one is close, one differs in both limits and one in the first, and one is missing.
MIXED = {"0.png": SAME, "1.png": DIFFERENT, "2.png": CLOSE, "4.png": changed(9, -9)}


def compared(folder: Path, actual: dict[str, Pixels], *missing: str, **reports: Path) -> Any:
    return compare_pictures(folder, dict.fromkeys([*actual, *missing], GREY), actual, LIMITS, **reports)


# The terminal


def test_frames_that_pass_are_summed_up(tmp_path: Path) -> None:
    limits = "exact (with other limits: largest 1, bias 0.01 by option)"
    assert comparison_table(compared(tmp_path, {"a.png": SAME})) == f"1 frame passes at {limits}: 1 the same"


def test_the_frame_that_passes_most_narrowly_is_named(tmp_path: Path) -> None:
    comparison = compared(tmp_path, {"a.png": SAME, "b.png": changed(1, -1), "c.png": changed(1, 1)})
    assert comparison_table(comparison).splitlines()[1:] == [
        "  b.png: within the limits; the closest is largest error of a channel 1 step, at most 1"
    ]


def test_a_long_table_names_the_number_of_further_frames(tmp_path: Path) -> None:
    comparison = compared(tmp_path, {f"{number}.png": changed(2 + number) for number in range(23)})
    lines = comparison_table(comparison).splitlines()
    assert len(lines) == 1 + 20 + 3
    assert lines[1 + 20] == "... and 3 more frames that fail; --json FILE has all of them"


# Files


def suite_of(report: Path) -> ElementTree.Element:
    """Return the test suite of a JUnit report."""
    (suite,) = ElementTree.parse(report).getroot()
    return suite


def test_every_file_names_other_limits_with_the_level(tmp_path: Path) -> None:
    goldens = write_pictures(tmp_path / "golden", {"a.png": GREY})
    (goldens / "compare.yaml").write_text("limits: {largest: 6}", "utf-8")
    frames = write_pictures(tmp_path / "actual", {"a.png": DIFFERENT})
    compare_files(goldens, frames, None, ["flip=none"], json=tmp_path / "a.json", junit=tmp_path / "a.xml")
    others = [f"largest 6 by {goldens / 'compare.yaml'}", "flip none by option"]
    words = f"same-machine (with other limits: {'; '.join(others)})"
    assert json.loads((tmp_path / "a.json").read_bytes())["other_limits"] == others
    assert suite_of(tmp_path / "a.xml").get("name") == f"{goldens} at {words}"
    assert f"level: {words}\n" in (tmp_path / "a.xml").read_text("utf-8")


def test_json_has_all_results_worst_first(tmp_path: Path) -> None:
    compared(tmp_path, MIXED, "3.png", json=tmp_path / "a.json")
    data = json.loads((tmp_path / "a.json").read_bytes())
    assert data["passes"] is False
    sides = (str(tmp_path / "golden"), str(tmp_path / "actual"))
    assert (data["level"], data["golden"], data["actual"]) == ("exact", *sides)
    assert data["counts"] == {
        "different": 2, "missing": 1, "extra": 0, "other size": 0, "other channels": 0, "same": 1, "close": 1,
    }  # fmt: skip
    metric = {"label": "largest error of a channel", "unit": "steps", "higher_is_better": False}
    assert data["figures"]["largest"] == metric
    assert [frame["name"] for frame in data["frames"]] == ["3.png", "4.png", "1.png", "2.png", "0.png"]
    assert data["frames"][2] == {
        "name": "1.png",
        "number": 1,
        "status": "different",
        "passes": False,
        "why": "largest error of a channel 7 steps, at most 1",
        "figures": {"largest": 7, "bias": 7 / 256},
        "limits": {"largest": 1, "bias": 0.01},
        "exceeded": ["largest", "bias"],
        "bias": [0, 7 / 256, 0],
    }


def test_junit_has_the_elements_that_ci_systems_read(tmp_path: Path) -> None:
    """These are the elements and attributes in the schema of Jenkins' plugin, which others follow."""
    compared(tmp_path, MIXED, "3.png", junit=tmp_path / "a.xml")
    root = ElementTree.parse(tmp_path / "a.xml").getroot()
    counts = {"tests": "5", "failures": "3", "errors": "0"}
    assert (root.tag, root.attrib) == ("testsuites", {"name": "hsplat compare", **counts})
    (suite,) = root
    golden, level = str(tmp_path / "golden"), "exact (with other limits: largest 1, bias 0.01 by option)"
    assert (suite.tag, suite.attrib) == ("testsuite", {"name": f"{golden} at {level}", **counts, "skipped": "0"})
    cases = [case for case in suite if case.tag == "testcase"]
    assert [case.attrib for case in cases] == [
        {"classname": golden, "name": name} for name in ("3.png", "4.png", "1.png", "2.png", "0.png")
    ]
    assert [len(case) for case in cases] == [1, 1, 1, 0, 0]
    failure = cases[2][0]
    message = "different: largest error of a channel 7 steps, at most 1; 1 more figure over its limit"
    assert (failure.tag, failure.attrib) == ("failure", {"message": message, "type": "different"})
    assert failure.text == (
        "largest error of a channel 7 steps, at most 1\n"
        f"golden: {golden}\n"
        f"actual: {tmp_path / 'actual'}\n"
        f"level: {level}\n"
        "FAILS: largest error of a channel 7 steps, at most 1\n"
        "FAILS: mean signed error of the most shifted channel 0.0273 steps, at most 0.01\n"
        "mean signed errors of the channels 0, 0.0273, 0 steps, without a limit"
    )


@pytest.mark.parametrize("name", ["]]> & <c>.png", "two\nlines\udcff\u202e.png", "\x01 \ufffe \U0001f600.png"])
def test_any_name_can_be_reported(name: str, tmp_path: Path) -> None:
    comparison = compared(tmp_path, {"b.png": SAME}, name, json=tmp_path / "a.json", junit=tmp_path / "a.xml")
    assert next(suite_of(tmp_path / "a.xml").iter("testcase")).get("name") == printable(name)
    assert json.loads((tmp_path / "a.json").read_bytes())["frames"][0]["name"] == name
    assert comparison_table(comparison).splitlines()[1].startswith(f"{printable(name)}  ")
