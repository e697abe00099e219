"""`parse_duration` reads durations such as 1h30m."""

from __future__ import annotations

import pytest
from hypothesis import given, strategies as st

from hsplat_cli.terminal import parse_duration
from renderer.errors import InputError


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("90", 90), ("0.25", 0.25), ("0.5s", 0.5), ("1.5m", 90), ("0.5h", 1800), ("1h30m", 5400), ("1h0.5m", 3630),
        ("1h30s", 3630), ("1h2m3.5s", 3723.5), ("90m", 5400), (" 10m ", 600),
    ],
)  # fmt: skip
def test_reads(text: str, seconds: float) -> None:
    assert parse_duration(text, where="--time-limit") == seconds


@pytest.mark.parametrize(
    "text",
    [
        "", " ", "x", "s", "h", ".", ".s", "-1", "-1s", "1e3", "inf", "nan", "1d", "1 h", "1h 30m", "1m1h", "1s1m",
        "1h1h", "1h30", "1m30", "1h2m3", "1.5h30", "1.5h30m", "1.h30m", "0.5m30s", "1h0.5m1s", "1.5.5s",
        "1\nh", "1h\n1", "\u0661s", "9" * 28,
    ],
)  # fmt: skip
def test_refuses(text: str) -> None:
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


_NUM = st.none() | st.integers(0, 10**6)


@given(_NUM, _NUM, _NUM)
def test_is_the_sum_of_its_parts(hours: int | None, minutes: int | None, seconds: int | None) -> None:
    parts = ((hours, "h", 3600), (minutes, "m", 60), (seconds, "s", 1))
    text = "".join(f"{number}{unit}" for number, unit, _ in parts if number is not None)
    total = sum(number * factor for number, _, factor in parts if number is not None)
    if total:
        assert parse_duration(text, where="") == total
    else:
        with pytest.raises(InputError):
            parse_duration(text, where="")
