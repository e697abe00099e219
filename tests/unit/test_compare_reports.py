"""What came of a comparison as text, JSON and JUnit XML."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import Any
from xml.etree import ElementTree

import pytest
from hypothesis import given, strategies as st

from hsplat_cli.compare import comparison_table
from hsplat_cli.compare.figure_format import printable
from hsplat_cli.compare.outcome import Comparison, Outcome
from hsplat_cli.compare.text_reports import MAX_ROWS, comparison_json, comparison_junit

LIMITS = {"largest": 1.0, "flip": 0.01}


def close(name: str, largest: float = 1.0) -> Outcome:
    why = f"within the limits; the closest is largest error of a channel {largest:g} level, at most 1"
    return Outcome(name, "close", why, {"largest": largest, "flip": 0.0}, LIMITS, (), (0.0, 0.0, 0.001))


def different(name: str, largest: float = 7.0, flip: float = 0.5) -> Outcome:
    why = f"largest error of a channel {largest:g} levels, at most 1"
    exceeded = ["largest", *(["flip"] if flip > 0.01 else [])]
    return Outcome(name, "different", why, {"largest": largest, "flip": flip}, LIMITS, exceeded, (0.5, -0.25, 0.0), 7)


def same(name: str) -> Outcome:
    return Outcome(name, "same", "the same pixels", {"largest": 0.0, "flip": 0.0}, LIMITS, (), (0.0, 0.0, 0.0))


def missing(name: str) -> Outcome:
    return Outcome(name, "missing", "ACTUAL has no such frame", limits=LIMITS)


def comparison(outcomes: Sequence[Outcome], **fields: Any) -> Comparison:
    return Comparison("golden", "actual", "same-machine", outcomes, **fields)


MIXED = comparison([same("a.png"), different("b.png"), close("c.png"), missing("d.png"), different("e.png", 9, 0.001)])


# The terminal


def test_a_table_is_short_when_all_is_well() -> None:
    text = comparison_table(comparison([same(f"{number}.png") for number in range(118)]))
    assert text == "118 frames pass at same-machine: 118 the same"
    text = comparison_table(
        comparison([same(f"{number}.png") for number in range(118)] + [close("x.png", 0.5), close("y.png")])
    )
    assert text == (
        "120 frames pass at same-machine: 118 the same, 2 close\n"
        "  y.png: within the limits; the closest is largest error of a channel 1 level, at most 1"
    )


def test_a_table_of_one() -> None:
    assert comparison_table(comparison([same("a.png")])) == "1 frame passes at same-machine: 1 the same"
    assert comparison_table(comparison([missing("a.png")])).endswith("\n\n1 of 1 frame fails: 1 missing")


def test_a_table_of_what_fails() -> None:
    assert comparison_table(MIXED) == (
        "frame  status     reason\n"
        "d.png  missing    ACTUAL has no such frame\n"
        "b.png  different  largest error of a channel 7 levels, at most 1; 1 more figure over its limit\n"
        "e.png  different  largest error of a channel 9 levels, at most 1\n"
        "\n"
        "3 of 5 frames fail: 2 different, 1 missing, 1 the same, 1 close"
    )


def test_a_long_table_is_cut() -> None:
    outcomes = [different(f"{number}.png", 2 + number) for number in range(MAX_ROWS + 3)]
    lines = comparison_table(comparison(outcomes)).splitlines()
    assert len(lines) == 1 + MAX_ROWS + 3
    assert lines[1 + MAX_ROWS] == "... and 3 more frames that fail; --json FILE has all of them"


def test_notes_are_told_always_and_facts_where_it_fails() -> None:
    facts = {"driver": ("llvmpipe 1", "llvmpipe 2"), "numpy": ("2.0", "2.0")}
    notes = ["films are lossy", "in two\nlines"]
    assert comparison_table(comparison([same("a.png")], notes=notes, facts=facts)).splitlines()[1:] == [
        "note: films are lossy",
        "note: in two\\nlines",
    ]
    assert comparison_table(comparison([missing("a.png")], notes=notes, facts=facts)).splitlines()[4:] == [
        "note: films are lossy",
        "note: in two\\nlines",
        "driver: llvmpipe 2; of the goldens: llvmpipe 1",
        "hint: another driver causes small differences; --level cross-driver allows for them",
    ]
    outcome = Comparison("golden", "actual", "cross-driver", [missing("a.png")], facts=facts)
    assert "hint" not in comparison_table(outcome)


# Files


def test_the_level_is_not_named_without_other_limits() -> None:
    others = ["largest 200 by g/compare.yaml", "flip none by option"]
    told = comparison([close("a.png")], other_limits=others)
    words = "same-machine (with other limits: largest 200 by g/compare.yaml; flip none by option)"
    assert comparison_table(told).splitlines()[0] == f"1 frame passes at {words}: 1 close"
    assert json.loads(comparison_json(told))["other_limits"] == others
    assert ElementTree.fromstring(comparison_junit(told).encode())[0].get("name") == f"golden at {words}"
    assert f"level: {words}\n" in comparison_junit(comparison([different("a.png")], other_limits=others))


def test_json_has_everything_worst_first() -> None:
    data = json.loads(comparison_json(MIXED))
    assert (data["passes"], data["level"], data["golden"], data["actual"]) == (
        False,
        "same-machine",
        "golden",
        "actual",
    )
    assert data["counts"] == {
        "different": 2, "missing": 1, "extra": 0, "other size": 0, "other channels": 0, "same": 1, "close": 1,
    }  # fmt: skip
    assert data["figures"]["largest"] == {
        "label": "largest error of a channel",
        "unit": "levels",
        "higher_is_better": False,
    }
    assert [frame["name"] for frame in data["frames"]] == ["d.png", "b.png", "e.png", "c.png", "a.png"]
    assert data["frames"][1] == {
        "name": "b.png",
        "number": 7,
        "status": "different",
        "passes": False,
        "why": "largest error of a channel 7 levels, at most 1",
        "figures": {"largest": 7, "flip": 0.5},
        "limits": {"largest": 1, "flip": 0.01},
        "exceeded": ["largest", "flip"],
        "bias": [0.5, -0.25, 0],
    }


def test_junit_is_what_ci_systems_read() -> None:
    """The elements and attributes that the schema of Jenkins' plugin asks for, which others follow."""
    root = ElementTree.fromstring(comparison_junit(MIXED).encode())
    assert (root.tag, root.attrib) == (
        "testsuites",
        {"name": "hsplat compare", "tests": "5", "failures": "3", "errors": "0"},
    )
    (suite,) = root
    assert (suite.tag, suite.attrib) == (
        "testsuite",
        {"name": "golden at same-machine", "tests": "5", "failures": "3", "errors": "0", "skipped": "0"},
    )
    assert [(case.tag, case.attrib) for case in suite] == [
        ("testcase", {"classname": "golden", "name": name}) for name in ("d.png", "b.png", "e.png", "c.png", "a.png")
    ]
    assert [len(case) for case in suite] == [1, 1, 1, 0, 0]
    failure = suite[1][0]
    assert (failure.tag, failure.attrib) == (
        "failure",
        {
            "message": "different: largest error of a channel 7 levels, at most 1; 1 more figure over its limit",
            "type": "different",
        },
    )
    assert failure.text == (
        "largest error of a channel 7 levels, at most 1\n"
        "golden: golden\n"
        "actual: actual\n"
        "level: same-machine\n"
        "FAILS: largest error of a channel 7 levels, at most 1\n"
        "FAILS: mean FLIP 0.5, at most 0.01\n"
        "mean signed errors of the channels 0.5, -0.25, 0 levels, without a limit"
    )


def test_notes_in_junit() -> None:
    suite = ElementTree.fromstring(comparison_junit(comparison([same("a.png")], notes=["one", "two"])).encode())[0]
    assert [child.tag for child in suite] == ["testcase", "system-out"]
    assert suite[1].text == "one\ntwo"


def test_facts_in_junit() -> None:
    facts = {"driver": ("llvmpipe 1", "llvmpipe 2")}
    suite = ElementTree.fromstring(comparison_junit(comparison([same("a.png")], facts=facts)).encode())[0]
    assert [child.tag for child in suite] == ["properties", "testcase"]
    assert [(each.tag, each.attrib) for each in suite[0]] == [
        ("property", {"name": "golden driver", "value": "llvmpipe 1"}),
        ("property", {"name": "actual driver", "value": "llvmpipe 2"}),
    ]


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ('a "b" & <c>.png', 'a "b" & <c>.png'),
        ("\x00\x01\x1b[31m.png", "\\x00\\x01\\x1b[31m.png"),
        ("two\nlines\r\t.png", "two\\nlines\\r\\t.png"),
        (os.fsdecode(b"\xff\xfe.png"), "\\xff\\xfe.png"),
        ("\ufffe\U0001ffff.png", "\\ufffe\\U0001ffff.png"),
        ("é 雪 😀.png", "é 雪 😀.png"),
        ("]]>.png", "]]>.png"),
        ("\u202egnp.png", "\\u202egnp.png"),
    ],
)
def test_odd_names(name: str, shown: str) -> None:
    assert printable(name) == shown
    told = comparison([missing(name), different("b.png")])
    assert comparison_table(told).splitlines()[1].startswith(f"{shown}  ")
    assert json.loads(comparison_json(told))["frames"][0]["name"] == name
    assert ElementTree.fromstring(comparison_junit(told).encode())[0][0].get("name") == shown


@given(st.text(st.characters(codec=None, categories=None), max_size=20))
def test_any_name_gives_xml_that_can_be_read(name: str) -> None:
    told = Comparison(name, name, "exact", [missing(name)], notes=[name])
    (suite,) = ElementTree.fromstring(comparison_junit(told).encode())
    assert suite[0].get("name") == printable(name)
    json.loads(comparison_json(told).encode())
    comparison_table(told).encode()


def test_the_same_comparison_gives_the_same_text() -> None:
    for text_of in (comparison_table, comparison_json, comparison_junit):
        assert text_of(MIXED) == text_of(comparison(list(MIXED.outcomes)))
