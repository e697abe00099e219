"""The tail of a stream is its last lines."""

from __future__ import annotations

import os

import pytest

from renderer.film import StreamTail


@pytest.mark.parametrize(
    ("words", "lines"),
    [
        (b"", []),
        (b"one\n\n  two  \r\n\n", ["one", "two"]),
        (b"\xff end", ["\N{REPLACEMENT CHARACTER} end"]),
        (b"x" * 100_000 + b"\n" + b"y" * 1990 + b"\nlast", ["xxxx", "y" * 1990, "last"]),  # more than a pipe holds
    ],
)
def test_the_last_lines(words: bytes, lines: list[str]) -> None:
    end, start = os.pipe()
    tail = StreamTail(os.fdopen(end, "rb"))
    with os.fdopen(start, "wb") as stream:
        stream.write(words)
    assert tail.lines() == lines


def test_a_stream_that_does_not_end() -> None:
    """Some other process may hold on to it: there is what has come."""
    end, start = os.pipe()
    tail = StreamTail(os.fdopen(end, "rb"))
    with os.fdopen(start, "wb", buffering=0) as stream:
        stream.write(b"so far\n")
        assert tail.lines() == ["so far"]
