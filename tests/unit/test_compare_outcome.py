"""The outcome of pairs of pictures whose differences are known."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from comparing import compare_pictures
from png_files import noise

from hsplat_cli.compare import COMPARISON_METRICS
from renderer.film import Pixels

LIMITS = {"largest": 2.0, "p99": 1.0, "densest": 1.0, "bias": 0.5}
GREY = np.full((16, 16, 3), 100, np.uint8)


def changed(by: int, rows: slice = slice(None), columns: slice = slice(None)) -> Pixels:
    """Return GREY with a green that is higher by `by` steps in some pixels."""
    picture = GREY.copy()
    picture[rows, columns, 1] += np.uint8(by)
    return picture


def outcome_of(
    folder: Path, actual: Pixels | None, golden: Pixels | None = GREY, limits: Mapping[str, float | str] = LIMITS
) -> Any:
    """Return the outcome of a frame, beside which there is another one on both sides."""
    sides = [{"b.png": GREY} | ({} if side is None else {"a.png": side}) for side in (golden, actual)]
    return compare_pictures(folder, *sides, limits).outcomes[0]


def test_equal_pixels_are_the_same(tmp_path: Path) -> None:
    outcome = outcome_of(tmp_path, GREY, limits={**LIMITS, "ssim": 0.9})
    assert (outcome.status, outcome.passes, outcome.why, outcome.severity) == ("same", True, "the same pixels", 0)
    assert outcome.figures == {"largest": 0, "p99": 0, "densest": 0, "bias": 0, "ssim": 1}
    assert outcome.bias == (0, 0, 0)


def test_a_frame_within_its_limits_is_close(tmp_path: Path) -> None:
    outcome = outcome_of(tmp_path, changed(2, slice(1), slice(1)))
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
def test_the_first_metric_over_its_limit_is_the_reason(
    actual: Pixels, exceeded: list[str], why: str, tmp_path: Path
) -> None:
    outcome = outcome_of(tmp_path, actual)
    assert (outcome.status, outcome.exceeded, outcome.why) == ("different", exceeded, why)


@pytest.mark.parametrize("level", ["exact", "same-machine"])
def test_a_hole_is_worse_than_many_roundings(level: str, tmp_path: Path) -> None:
    golden = np.full((64, 64, 3), 250, np.uint8)
    rounded, hole = golden.copy(), golden.copy()
    rounded[np.random.default_rng(2).random((64, 64)) < 0.03] -= np.uint8(1)
    hole[8:14, 8:14] = 9
    actual = {"rounded 0.png": rounded, "rounded 1.png": rounded, "hole.png": hole}
    comparison = compare_pictures(tmp_path, dict.fromkeys([*actual, "missing.png"], golden), actual, level=level)
    assert comparison.num_failing == 4
    names = [outcome.name for outcome in comparison.worst_first]
    assert names == ["missing.png", "hole.png", "rounded 0.png", "rounded 1.png"]


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
def test_frames_without_an_equal_shape_fail(
    golden: Pixels | None, actual: Pixels | None, status: str, why: str, tmp_path: Path
) -> None:
    outcome = outcome_of(tmp_path, actual, golden)
    assert (outcome.status, outcome.why, outcome.passes) == (status, why, False)


def test_alpha_is_compared(tmp_path: Path) -> None:
    golden = np.zeros((16, 16, 4), np.uint8)
    golden[..., 3] = 90
    actual = golden.copy()
    actual[3, 3, 3] -= 5
    outcome = outcome_of(tmp_path, actual, golden)
    assert outcome.why == "largest error of a channel 5 steps, at most 2"
    assert outcome.bias == (0, 0, 0, -5 / 256)


@pytest.mark.parametrize("alpha", [0, 1])
def test_invisible_colours_are_no_difference(alpha: int, tmp_path: Path) -> None:
    golden, actual = np.zeros((16, 16, 4), np.uint8), np.zeros((16, 16, 4), np.uint8)
    actual[..., :3] = 200
    actual[0, 0, 3] = alpha
    outcome = outcome_of(tmp_path, actual, golden, {"largest": 0.0})
    assert (outcome.status, outcome.severity > 0) == (("close", False) if alpha == 0 else ("different", True))
    assert (outcome.why == "the same picture: only colours at an alpha of 0 differ") == (alpha == 0)


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        (["frame-0007", "frame-0010"], [7, 10]), (["v2-frame9", "v2-frame10"], [9, 10]),
        (["frame 0", "frame 1"], [0, 1]), (["back-2", "front-2"], []), (["01", "1"], []),
        (["1", "still"], []), (["still"], []),
    ],
)  # fmt: skip
def test_frames_have_the_number_in_their_names(names: list[str], numbers: list[int], tmp_path: Path) -> None:
    pictures = {f"{name}.png": GREY for name in names}
    comparison = compare_pictures(tmp_path, pictures, pictures)
    assert list(comparison.frame_numbers.values()) == numbers


def figure_in(why: str) -> str:
    """Return the figure in a reason that ends with it and its limit."""
    return why.rpartition(", at ")[0].removesuffix("s").removesuffix(" step").rpartition(" ")[2]


@pytest.mark.parametrize("metric", COMPARISON_METRICS)
def test_figures_have_three_digits_or_show_on_which_side_of_a_limit_they_are(metric: str, tmp_path: Path) -> None:
    golden = noise(1)
    actual = np.clip(golden.astype(int) + np.random.default_rng(2).integers(-9, 8, golden.shape), 0, 255)
    compared = COMPARISON_METRICS[metric]

    def outcome_at(limit: float, name: str) -> Any:
        (tmp_path / name).mkdir()
        return outcome_of(tmp_path / name, actual.astype(np.uint8), golden, {"largest": "none", metric: limit})

    figure = outcome_at(0.5, "far").figures[metric]
    for name, limit in (("below", figure * 0.99999), ("same", figure), ("above", figure * 1.00001)):
        outcome = outcome_at(limit, name)
        assert compared.passes(float(figure_in(outcome.why)), limit) == outcome.passes, name
    text = figure_in(outcome_at(0.0 if figure > 0.5 else 1.0, "apart").why)
    assert text == f"{figure:.3g}"
