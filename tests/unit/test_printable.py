"""Text is made printable once, reversibly enough to tell what was there, and lines of ours stay lines."""

from __future__ import annotations

import pickle

import pytest
from hypothesis import given, strategies as st

from hsplat_cli.terminal import format_table
from renderer.errors import InputError, Problem, RenderError, SceneError
from renderer.system import join_lines, printable


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("scan 1.nrrd", "scan 1.nrrd"),
        ("Schädel 雪 😀 \\x1b", "Schädel 雪 😀 \\x1b"),
        ("\x1b[31m\x07\x7f\x9b", r"\x1b[31m\x07\x7f\x9b"),
        ("two\nlines\r\t\x85\u2028", r"two\nlines\r\t\x85\u2028"),
        ("\u202a\u202e\u2066\u2069", r"\u202a\u202e\u2066\u2069"),
        ("\u200b\u200d\ufeff\xad\u034f\u3164\ufe0f\U000e0101", r"\u200b\u200d\ufeff\xad\u034f\u3164\ufe0f\U000e0101"),
        ("\udc9b", r"\udc9b"),
    ],
)
def test_what_is_not_printable_becomes_an_escape(text: str, shown: str) -> None:
    assert printable(text) == shown
    assert printable(shown) == shown


@given(st.text(st.characters(codec=None, categories=None)))
def test_any_text_is_one_line_that_can_be_encoded(text: str) -> None:
    shown = printable(text)
    assert shown.isprintable()
    assert shown.encode("utf-8").decode("utf-8") == shown
    assert join_lines([shown, text]) == f"{shown}\n{shown}"


def test_a_line_break_in_a_value_begins_no_line_of_a_message() -> None:
    error = InputError("no\nfile", where="a\n.npy", got="b\n", expected="\nc", hint="d\n  hint: e")
    assert str(error).split("\n") == [r"a\n.npy: no\nfile", r"  got: b\n", r"  expected: \nc", r"  hint: d\n  hint: e"]
    problem = Problem("camera\n.path", "unknown key", location="\x1bscene.yaml:1:1")
    assert str(SceneError([problem, problem])).split("\n") == [r"\x1bscene.yaml:1:1: camera\n.path: unknown key"] * 2


def test_the_lines_of_a_program_stay_lines_of_a_message_also_from_another_process() -> None:
    error = RenderError("ffmpeg stopped", got=join_lines(["exit status 1", "\x1b[31mno\n", "codec"]))
    expected = "ffmpeg stopped\n  got: exit status 1\n    \\x1b[31mno\\n\n    codec"
    assert str(error) == expected
    assert str(pickle.loads(pickle.dumps(error))) == expected


def test_columns_of_a_table_are_aligned_by_what_is_shown() -> None:
    assert format_table([["a\n", "b"], ["c", "d"]]).split("\n") == [r"a\n  b", "c    d"]
