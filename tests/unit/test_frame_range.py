"""`--frames` picks frames as Python slices do, forward only."""

from __future__ import annotations

import pytest
from hypothesis import given, strategies as st

from hsplat_cli.terminal import is_one_frame, parse_frames
from renderer.errors import InputError


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        (None, [0, 1, 2, 3, 4, 5]), ("0", [0]), ("5", [5]), (" 2 ", [2]), (" 1 : 3 ", [1, 2]), ("-1", [5]),
        ("-6", [0]), (f"4:{10**40}", [4, 5]), (f"4::{10**40}", [4]),
    ],
)  # fmt: skip
def test_picks(text: str | None, frames: list[int]) -> None:
    assert list(parse_frames(text, 6)) == frames


@pytest.mark.parametrize(
    "text",
    ["", "  ", "x", "1,2", "1-3", "1:2:3:4", "1.5", "1e1", "0x1", "6", "-7", "-8", str(10**40), "3:3", "::0", "::-1"],
)
def test_refuses(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_frames(text, 6)
    assert caught.value.where == "--frames"


_END = st.none() | st.integers(-20, 20)


@given(_END, _END, st.none() | st.integers(1, 9), st.integers(1, 12))
def test_is_a_slice(start: int | None, stop: int | None, step: int | None, num_frames: int) -> None:
    text = ":".join("" if part is None else str(part) for part in (start, stop, step))
    expected = list(range(num_frames))[start:stop:step]
    if expected:
        assert list(parse_frames(text, num_frames)) == expected
    else:
        with pytest.raises(InputError):
            parse_frames(text, num_frames)


def test_one_frame_of_any_path_is_recognised() -> None:
    for text in ("7", " 7 ", "-1", "-8", "7:8", " 7 : 8 ", "7:8:", "7:8:1", "0:1"):
        assert is_one_frame(text), text
        assert len(parse_frames(text, 100)) == 1
    for text in (None, ":", "::", "7:9", "7:9:2", "7:8:2", "7:", ":1", "-1:", "-2:-1", "-1:0", "8:7", "7:7", "x:y"):
        assert not is_one_frame(text), text
