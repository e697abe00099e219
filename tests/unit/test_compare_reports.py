"""A comparison as text, JSON and JUnit XML."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

from hypothesis import example, given, strategies as st

from hsplat_cli.compare import MAX_ROWS, Comparison, Outcome, comparison_json, comparison_junit, comparison_table
from renderer.system import printable

LIMITS = {"largest": 1.0, "flip": 0.01}


def close(name: str, largest: float = 1.0) -> Outcome:
    why = f"within the limits; the closest is largest error of a channel {largest:g} step, at most 1"
    return Outcome(name, "close", why, LIMITS, {"largest": largest, "flip": 0.0}, (), (0.0, 0.0, 0.001))


def different(name: str, largest: float = 7.0, flip: float = 0.5) -> Outcome:
    why = f"largest error of a channel {largest:g} steps, at most 1"
    exceeded = ["largest", *(["flip"] if flip > 0.01 else [])]
    return Outcome(name, "different", why, LIMITS, {"largest": largest, "flip": flip}, exceeded, (0.5, -0.25, 0.0))


def same(name: str) -> Outcome:
    return Outcome(name, "same", "the same pixels", LIMITS, {"largest": 0.0, "flip": 0.0}, (), (0.0, 0.0, 0.0))


def missing(name: str) -> Outcome:
    return Outcome(name, "missing", "ACTUAL has no such frame", limits=LIMITS)


def comparison(outcomes: Sequence[Outcome], **fields: Any) -> Comparison:
    return Comparison("golden", "actual", "same-machine", outcomes, **fields)


MIXED = comparison([same("0.png"), different("1.png"), close("2.png"), missing("3.png"), different("4.png", 9, 0.001)])


# The terminal


def test_frames_that_pass_are_summed_up() -> None:
    assert comparison_table(comparison([same("a.png")])) == "1 frame passes at same-machine: 1 the same"
    assert comparison_table(comparison([same("a.png"), close("b.png", 0.5), close("c.png")])) == (
        "3 frames pass at same-machine: 1 the same, 2 close\n"
        "  c.png: within the limits; the closest is largest error of a channel 1 step, at most 1"
    )


def test_a_long_table_names_the_number_of_further_frames() -> None:
    outcomes = [different(f"{number}.png", 2 + number) for number in range(MAX_ROWS + 3)]
    lines = comparison_table(comparison(outcomes)).splitlines()
    assert len(lines) == 1 + MAX_ROWS + 3
    assert lines[1 + MAX_ROWS] == "... and 3 more frames that fail; --json FILE has all of them"


# Files


def suite_of(found: Comparison) -> ElementTree.Element:
    """Return the test suite of the JUnit report."""
    (suite,) = ElementTree.fromstring(comparison_junit(found).encode())
    return suite


def test_every_report_names_other_limits_with_the_level() -> None:
    others = ["largest 200 by g/compare.yaml", "flip none by option"]
    found = comparison([close("a.png")], other_limits=others)
    words = "same-machine (with other limits: largest 200 by g/compare.yaml; flip none by option)"
    assert comparison_table(found).splitlines()[0] == f"1 frame passes at {words}: 1 close"
    assert json.loads(comparison_json(found))["other_limits"] == others
    assert suite_of(found).get("name") == f"golden at {words}"
    assert f"level: {words}\n" in comparison_junit(comparison([different("a.png")], other_limits=others))


def test_json_has_all_results_worst_first() -> None:
    data = json.loads(comparison_json(MIXED))
    assert data["passes"] is False
    assert (data["level"], data["golden"], data["actual"]) == ("same-machine", "golden", "actual")
    assert data["counts"] == {
        "different": 2, "missing": 1, "extra": 0, "other size": 0, "other channels": 0, "same": 1, "close": 1,
    }  # fmt: skip
    metric = {"label": "largest error of a channel", "unit": "steps", "higher_is_better": False}
    assert data["figures"]["largest"] == metric
    assert [frame["name"] for frame in data["frames"]] == ["3.png", "1.png", "4.png", "2.png", "0.png"]
    assert data["frames"][1] == {
        "name": "1.png",
        "number": 1,
        "status": "different",
        "passes": False,
        "why": "largest error of a channel 7 steps, at most 1",
        "figures": {"largest": 7, "flip": 0.5},
        "limits": {"largest": 1, "flip": 0.01},
        "exceeded": ["largest", "flip"],
        "bias": [0.5, -0.25, 0],
    }


def test_junit_has_the_elements_that_ci_systems_read() -> None:
    """These are the elements and attributes in the schema of Jenkins' plugin, which others follow."""
    root = ElementTree.fromstring(comparison_junit(MIXED).encode())
    counts = {"tests": "5", "failures": "3", "errors": "0"}
    assert (root.tag, root.attrib) == ("testsuites", {"name": "hsplat compare", **counts})
    (suite,) = root
    assert (suite.tag, suite.attrib) == ("testsuite", {"name": "golden at same-machine", **counts, "skipped": "0"})
    assert [(case.tag, case.attrib) for case in suite] == [
        ("testcase", {"classname": "golden", "name": name}) for name in ("3.png", "1.png", "4.png", "2.png", "0.png")
    ]
    assert [len(case) for case in suite] == [1, 1, 1, 0, 0]
    failure = suite[1][0]
    message = "different: largest error of a channel 7 steps, at most 1; 1 more figure over its limit"
    assert (failure.tag, failure.attrib) == ("failure", {"message": message, "type": "different"})
    assert failure.text == (
        "largest error of a channel 7 steps, at most 1\n"
        "golden: golden\n"
        "actual: actual\n"
        "level: same-machine\n"
        "FAILS: largest error of a channel 7 steps, at most 1\n"
        "FAILS: mean FLIP 0.5, at most 0.01\n"
        "mean signed errors of the channels 0.5, -0.25, 0 steps, without a limit"
    )


def test_junit_has_facts_and_notes() -> None:
    facts = {"device": ("llvmpipe 1", "llvmpipe 2")}
    suite = suite_of(comparison([same("a.png")], facts=facts, notes=["one", "two"]))
    assert [child.tag for child in suite] == ["properties", "testcase", "system-out"]
    assert [(each.tag, each.attrib) for each in suite[0]] == [
        ("property", {"name": "golden device", "value": "llvmpipe 1"}),
        ("property", {"name": "actual device", "value": "llvmpipe 2"}),
    ]
    assert suite[2].text == "one\ntwo"


@example("]]> & <c>.png")
@example("two\nlines\udcff\u202e.png")
@given(st.text(st.characters(codec=None, categories=None), max_size=20))
def test_any_name_can_be_reported(name: str) -> None:
    found = Comparison(name, name, "exact", [missing(name)], notes=[name])
    assert suite_of(found)[0].get("name") == printable(name)
    assert json.loads(comparison_json(found).encode())["frames"][0]["name"] == name
    assert comparison_table(found).splitlines()[1].startswith(f"{printable(name)}  ")
