"""`--frames` picks frames as Python slices do, forward only; durations are such as 1h30m, and memory such as 2GB."""

from __future__ import annotations

import pytest
from hypothesis import given, strategies as st

from hsplat_cli.terminal import is_one_frame, parse_bytes, parse_duration, parse_frames
from renderer.errors import InputError


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        (None, [0, 1, 2, 3, 4, 5]), ("0", [0]), ("5", [5]), (" 2 ", [2]), (" 1 : 3 ", [1, 2]), ("-1", [5]),
        ("-6", [0]), (f"4:{10**40}", [4, 5]), (f"4::{10**40}", [4]),
    ],
)  # fmt: skip
def test_frames_are_picked(text: str | None, frames: list[int]) -> None:
    assert list(parse_frames(text, 6)) == frames


@pytest.mark.parametrize(
    "text",
    ["", "  ", "x", "1,2", "1-3", "1:2:3:4", "1.5", "1e1", "0x1", "6", "-7", "-8", str(10**40), "3:3", "::0", "::-1"],
)
def test_other_ranges_are_refused(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_frames(text, 6)
    assert caught.value.where == "--frames"


@pytest.mark.parametrize(
    ("text", "hint"),
    [("1-3", "1:4"), ("30..40", "30:41"), ("9 – 7", "7:10"), ("1-2-3", None), ("-1-3", None), ("1:x", None)],
)
def test_a_range_that_names_its_last_frame_gets_the_slice_as_a_hint(text: str, hint: str | None) -> None:
    with pytest.raises(InputError) as caught:
        parse_frames(text, 50)
    assert (caught.value.hint is None) if hint is None else str(caught.value.hint).startswith(f"--frames {hint} for")


_END = st.none() | st.integers(-20, 20)


@given(_END, _END, st.none() | st.integers(1, 9), st.integers(1, 12))
def test_a_range_is_a_slice(start: int | None, stop: int | None, step: int | None, num_frames: int) -> None:
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


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("90", 90), ("0.25", 0.25), ("0.5s", 0.5), ("1.5m", 90), ("0.5h", 1800), ("1h30m", 5400), ("1h0.5m", 3630),
        ("1h30s", 3630), ("1h2m3.5s", 3723.5), ("90m", 5400), (" 10m ", 600),
    ],
)  # fmt: skip
def test_durations_are_read(text: str, seconds: float) -> None:
    assert parse_duration(text, where="--time-limit") == seconds


@pytest.mark.parametrize(
    "text",
    [
        "", " ", "x", "s", "h", ".", ".s", "-1", "-1s", "1e3", "inf", "nan", "1d", "1 h", "1h 30m", "1m1h", "1s1m",
        "1h1h", "1h30", "1m30", "1h2m3", "1.5h30", "1.5h30m", "1.h30m", "0.5m30s", "1h0.5m1s", "1.5.5s",
        "1\nh", "1h\n1", "\u0661s", "9" * 28,
    ],
)  # fmt: skip
def test_other_durations_are_refused(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_duration(text, where="--time-limit")
    assert caught.value.what == "not a duration"
    assert caught.value.where == "--time-limit"


def test_a_duration_of_0_is_an_error() -> None:
    for text in ("0", "0.0", "0h0m"):
        with pytest.raises(InputError) as caught:
            parse_duration(text, where="--time-limit")
        expected = "a time such as 90s, 10m or 1h30m, more than 0"
        assert str(caught.value) == f"--time-limit: a duration of 0\n  got: '{text}'\n  expected: {expected}"


@pytest.mark.parametrize(
    ("text", "num_bytes"),
    [
        ("1", 1), ("1000000", 10**6), ("2GB", 2 * 10**9), ("2 gb", 2 * 10**9), ("512M", 512 * 10**6),
        ("1.5GiB", 3 * 2**29), ("3kib", 3072), ("1T", 10**12), (" 7 B ", 7),
    ],
)  # fmt: skip
def test_memory_is_read(text: str, num_bytes: int) -> None:
    assert parse_bytes(text, where="--memory") == num_bytes


@pytest.mark.parametrize("text", ["", "GB", "-1", "1e9", "2 G B", "2PB", "0", "0.0GB", "0.1", "1GB2", "9" * 10**6])
def test_other_memory_is_refused(text: str) -> None:
    with pytest.raises(InputError) as caught:
        parse_bytes(text, where="--memory")
    assert caught.value.where == "--memory"
