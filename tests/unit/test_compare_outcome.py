"""The outcome of pairs of pictures whose differences are known."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest

from hsplat_cli.compare import (
    STRICTNESSES,
    Comparison,
    Outcome,
    Pair,
    compare_pair,
    figure_text,
    limit_text,
    limits_text,
    share_text,
    signed_text,
    value_text,
)
from renderer.film import Pixels

LIMITS = {"largest": 2.0, "p99": 1.0, "densest": 1.0, "bias": 0.5}
GREY = np.full((16, 16, 3), 100, np.uint8)


def changed(by: int, rows: slice = slice(None), columns: slice = slice(None)) -> Pixels:
    """Return GREY with a green that is higher by `by` steps in some pixels."""
    picture = GREY.copy()
    picture[rows, columns, 1] += np.uint8(by)
    return picture


def outcome_of(actual: Pixels | None, golden: Pixels | None = GREY, limits: Mapping[str, float] = LIMITS) -> Outcome:
    return compare_pair(Pair("a.png", golden, actual), limits)


@pytest.mark.parametrize("actual", [GREY, GREY.copy()], ids=["one array", "equal arrays"])
def test_equal_pixels_are_the_same(actual: Pixels) -> None:
    outcome = outcome_of(actual, limits={**LIMITS, "ssim": 0.9})
    assert (outcome.status, outcome.passes, outcome.why, outcome.severity) == ("same", True, "the same pixels", 0)
    assert outcome.figures == {"largest": 0, "p99": 0, "densest": 0, "bias": 0, "ssim": 1}
    assert outcome.bias == (0, 0, 0)


def test_a_frame_within_its_limits_is_close() -> None:
    outcome = outcome_of(changed(2, slice(1), slice(1)))
    assert outcome.status == "close" and outcome.passes
    assert outcome.why == "within the limits; the closest is largest error of a channel 2 steps, at most 2"
    assert outcome.figures == {"largest": 2, "p99": 0, "densest": 2 / 64, "bias": 2 / 256}
    assert (outcome.exceeded, outcome.severity) == ([], 1)


@pytest.mark.parametrize(
    ("actual", "exceeded", "why"),
    [
        (changed(3, slice(1), slice(1)), ["largest"], "largest error of a channel 3 steps, at most 2"),
        (changed(2, slice(1), slice(9)), ["p99"], "99th percentile of the pixels' largest errors 2 steps, at most 1"),
        (changed(1), ["bias"], "mean signed error of the most shifted channel 1 step, at most 0.5"),
        (changed(9), ["largest", "p99", "densest", "bias"], "largest error of a channel 9 steps, at most 2"),
    ],
)
def test_the_first_metric_over_its_limit_is_the_reason(actual: Pixels, exceeded: list[str], why: str) -> None:
    outcome = outcome_of(actual)
    assert (outcome.status, outcome.exceeded, outcome.why) == ("different", exceeded, why)


@pytest.mark.parametrize("level", ["exact", "same-machine"])
def test_a_hole_is_worse_than_many_roundings(level: str) -> None:
    limits = STRICTNESSES[level].limits
    golden = np.full((64, 64, 3), 250, np.uint8)
    rounded, hole = golden.copy(), golden.copy()
    rounded[np.random.default_rng(2).random((64, 64)) < 0.03] -= np.uint8(1)
    hole[8:14, 8:14] = 9
    pairs = [*(Pair(f"rounded {number}", golden, rounded) for number in range(2)), Pair("hole", golden, hole)]
    outcomes = [*(compare_pair(pair, limits) for pair in pairs), outcome_of(None)]
    assert not any(outcome.passes for outcome in outcomes)
    worst = Comparison("golden", "actual", level, outcomes).worst_first
    assert [outcome.name for outcome in worst] == ["a.png", "hole", "rounded 0", "rounded 1"]


OPAQUE = np.dstack([GREY, np.full((16, 16), 255, np.uint8)])


@pytest.mark.parametrize(
    ("golden", "actual", "status", "why"),
    [
        (GREY, None, "missing", "ACTUAL has no such frame"),
        (None, GREY, "extra", "GOLDEN has no such frame"),
        (GREY, np.zeros((16, 17, 3), np.uint8), "other size", "17 x 16 pixels, the golden has 16 x 16"),
        (OPAQUE, GREY, "other channels", "RGB, the golden is RGBA: alpha is lost"),
        (GREY, OPAQUE, "other channels", "RGBA, the golden is RGB: alpha is new"),
    ],
)
def test_what_cannot_be_compared_fails(golden: Pixels | None, actual: Pixels | None, status: str, why: str) -> None:
    outcome = outcome_of(actual, golden)
    assert (outcome.status, outcome.why, outcome.passes) == (status, why, False)


def test_alpha_is_compared() -> None:
    golden = np.zeros((16, 16, 4), np.uint8)
    golden[..., 3] = 90
    actual = golden.copy()
    actual[3, 3, 3] -= 5
    outcome = outcome_of(actual, golden)
    assert outcome.why == "largest error of a channel 5 steps, at most 2"
    assert outcome.bias == (0, 0, 0, -5 / 256)


def test_invisible_colours_are_no_difference() -> None:
    golden, actual = np.zeros((16, 16, 4), np.uint8), np.zeros((16, 16, 4), np.uint8)
    actual[..., :3] = 200
    outcome = outcome_of(actual, golden, {"largest": 0.0})
    assert (outcome.status, outcome.severity) == ("close", 0)
    assert outcome.why == "the same picture: only colours at an alpha of 0 differ"
    actual[0, 0, 3] = 1
    assert outcome_of(actual, golden, {"largest": 0.0}).status == "different"


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        (["frame-0007.png", "frame-0010.png"], [7, 10]), (["v2-frame9.png", "v2-frame10.png"], [9, 10]),
        (["frame 0", "frame 1"], [0, 1]), (["front-2.png", "back-2.png"], []), (["1.png", "01.png"], []),
        (["1.png", "still.png"], []), (["still.png"], []),
    ],
)  # fmt: skip
def test_frames_have_the_number_in_their_names(names: list[str], numbers: list[int]) -> None:
    comparison = Comparison("golden", "actual", "exact", [Outcome(name, "same", "") for name in names])
    assert list(comparison.frame_numbers.values()) == numbers


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (figure_text("largest", 7.0, 1.0), "largest error of a channel 7 steps, at most 1"),
        (figure_text("largest", 1.0, 0.0), "largest error of a channel 1 step, at most 0"),
        (figure_text("flip", 0.00100049, 0.001), "mean FLIP 0.0010005, at most 0.001"),
        (figure_text("flip", 0.00099951, 0.001), "mean FLIP 0.001, at most 0.001"),
        (figure_text("ssim", 0.97996, 0.98), "mean SSIM 0.97996, at least 0.98"),
        (figure_text("ssim", 0.98, 0.98), "mean SSIM 0.98, at least 0.98"),
        (value_text("bias", float(np.nextafter(0.1, 1)), 0.1), "0.10000000000000002"),
        (value_text("flip", 0.123456, 0.1), "0.123"), (limit_text("ssim", 0.99), "at least 0.99"),
        (signed_text(0.1234), "+0.123"), (signed_text(0), "0"), (signed_text(-6.1e-5), "−6.1e−05"),
        (share_text(12.34), "12.3"), (share_text(math.inf), "∞"),
        (limits_text("largest", [4, 4]), "largest error of a channel, at most 4 steps"),
        (limits_text("largest", [1]), "largest error of a channel, at most 1 step"),
        (limits_text("flip", [0.1]), "mean FLIP, at most 0.1"),
        (limits_text("flip", [0.1, 0.2]), "mean FLIP, limits differ between frames"),
    ],
)  # fmt: skip
def test_numbers_show_on_which_side_of_a_limit_they_are(text: str, expected: str) -> None:
    assert text == expected
