"""The verdict on pairs of pictures whose differences are known."""

from __future__ import annotations

import importlib.util
from collections.abc import Mapping

import numpy as np
import pytest
from png_files import noise, smooth

from hsplat_cli.compare.figure_format import figure_text
from hsplat_cli.compare.judge import compare_pair, compare_pairs
from hsplat_cli.compare.outcome import Comparison, Outcome
from hsplat_cli.compare.pair import Pair
from hsplat_cli.compare.rules import Rules
from renderer.errors import InputError
from renderer.film import Pixels
from renderer.study import STRICTNESS_LEVELS

LIMITS = {"largest": 2.0, "p99": 1.0, "densest": 1.0, "bias": 0.5}
GREY = np.full((16, 16, 3), 100, np.uint8)


def changed(by: int, rows: slice = slice(None), columns: slice = slice(None), channel: int = 1) -> Pixels:
    picture = GREY.copy()
    picture[rows, columns, channel] += np.uint8(by)
    return picture


def verdict(actual: Pixels | None, golden: Pixels | None = GREY, limits: Mapping[str, float] = LIMITS) -> Outcome:
    return compare_pair(Pair("a.png", golden, actual, 3), limits)


def test_the_same_pixels() -> None:
    for actual in (GREY, GREY.copy()):
        outcome = verdict(actual, limits={**LIMITS, "ssim": 0.9})
        assert (outcome.status, outcome.passes, outcome.why, outcome.severity) == ("same", True, "the same pixels", 0)
        assert outcome.figures == {"largest": 0, "p99": 0, "densest": 0, "bias": 0, "ssim": 1}
        assert outcome.bias == (0, 0, 0)
        assert outcome.number == 3


def test_within_all_limits() -> None:
    outcome = verdict(changed(2, slice(1), slice(1)))
    assert outcome.status == "close" and outcome.passes
    assert outcome.why == "within the limits; the closest is largest error of a channel 2 levels, at most 2"
    assert outcome.figures == {"largest": 2, "p99": 0, "densest": 2 / 64, "bias": 2 / 256}
    assert outcome.exceeded == []
    assert outcome.severity == 1


@pytest.mark.parametrize(
    ("actual", "exceeded", "why"),
    [
        (changed(3, slice(1), slice(1)), ["largest"], "largest error of a channel 3 levels, at most 2"),
        (
            changed(2, slice(1), slice(9)),
            ["p99"],
            "99th percentile of the pixels' largest errors 2 levels, at most 1",
        ),
        (changed(1), ["bias"], "mean signed error of the most shifted channel 1 level, at most 0.5"),
        (
            changed(9),
            ["largest", "p99", "densest", "bias"],
            "largest error of a channel 9 levels, at most 2",
        ),
    ],
)
def test_the_first_figure_over_its_limit_is_the_reason(actual: Pixels, exceeded: list[str], why: str) -> None:
    outcome = verdict(actual)
    assert outcome.status == "different" and not outcome.passes
    assert (outcome.exceeded, outcome.why) == (exceeded, why)


def test_a_cluster_fails_where_noise_passes() -> None:
    rng = np.random.default_rng(1)
    noise_levels = rng.integers(0, 2, GREY.shape).astype(np.uint8)  # 0.5 levels in the mean, anywhere
    cluster = GREY.copy()
    cluster[4:12, 4:12] += np.uint8(2)
    limits = {"largest": 2.0, "densest": 1.0}
    assert verdict((GREY + noise_levels).astype(np.uint8), limits=limits).status == "close"
    outcome = verdict(cluster, limits=limits)
    assert outcome.why == "mean error of a channel in the densest window of 8 x 8 pixels 2 levels, at most 1"


def test_only_limited_figures_are_taken() -> None:
    assert verdict(changed(9), limits={"bias": 10.0}).figures == {"bias": 9}
    assert verdict(changed(9), limits={"bias": 10.0}).passes


def test_a_hole_is_worse_than_many_roundings() -> None:
    golden = np.full((64, 64, 3), 250, np.uint8)
    rounded, hole = golden.copy(), golden.copy()
    rounded[np.random.default_rng(2).random((64, 64)) < 0.03] -= np.uint8(1)
    hole[8:14, 8:14] = 9
    pairs = [*(Pair(f"rounded {number}", golden, rounded) for number in range(3)), Pair("hole", golden, hole)]
    for level in ("exact", "same-machine"):
        outcomes = compare_pairs(pairs, Rules(level), lambda outcome, pair: None)
        comparison = Comparison("golden", "actual", level, [*outcomes, verdict(None)])
        assert not any(outcome.passes for outcome in outcomes)
        worst = [outcome.name for outcome in comparison.worst_first]
        assert worst == ["a.png", "hole", "rounded 0", "rounded 1", "rounded 2"]
    assert (outcomes[0].figures["p99"], outcomes[-1].figures["p99"]) == (1, 0)


def test_bias_of_each_channel() -> None:
    assert verdict(changed(9, channel=2)).bias == (0, 0, 9)
    assert verdict(GREY, changed(9, channel=0)).bias == (-9, 0, 0)


def test_missing_and_extra() -> None:
    assert (verdict(None).status, verdict(None).why) == ("missing", "ACTUAL has no such frame")
    outcome = verdict(GREY, None)
    assert (outcome.status, outcome.why, outcome.passes) == ("extra", "GOLDEN has no such frame", False)


def test_other_sizes_and_channels() -> None:
    outcome = verdict(np.zeros((16, 17, 3), np.uint8))
    assert (outcome.status, outcome.why) == ("other size", "17 x 16 pixels, the golden has 16 x 16")
    opaque = np.dstack([GREY, np.full((16, 16), 255, np.uint8)])
    outcome = verdict(GREY, opaque)
    assert (outcome.status, outcome.why) == ("other channels", "RGB, the golden is RGBA: alpha is lost")
    outcome = verdict(opaque)
    assert (outcome.status, outcome.why) == ("other channels", "RGBA, the golden is RGB: alpha is new")
    assert not outcome.passes


def test_alpha_is_compared() -> None:
    golden = np.zeros((16, 16, 4), np.uint8)
    golden[..., 3] = 90
    actual = golden.copy()
    actual[3, 3, 3] += 5
    outcome = verdict(actual, golden)
    assert outcome.why == "largest error of a channel 5 levels, at most 2"
    assert outcome.bias == (0, 0, 0, 5 / 256)


def test_colours_that_nobody_sees_are_no_difference() -> None:
    golden, actual = np.zeros((16, 16, 4), np.uint8), np.zeros((16, 16, 4), np.uint8)
    actual[..., :3] = 200
    for limits in (LIMITS, {"largest": 0.0}):
        outcome = verdict(actual, golden, limits)
        assert outcome.status == "close" and outcome.severity == 0
        assert outcome.why == "the same picture: only colours at an alpha of 0 differ"
    actual[0, 0, 3] = 1
    assert verdict(actual, golden, {"largest": 0.0}).status == "different"


@pytest.mark.parametrize("level", STRICTNESS_LEVELS)
def test_every_level_judges(level: str) -> None:
    see: list[tuple[str, str]] = []
    pairs = [Pair("same", smooth(), smooth()), Pair("other", smooth(), smooth(0.5)), Pair("gone", smooth(), None)]
    outcomes = compare_pairs(pairs, Rules(level), lambda outcome, pair: see.append((outcome.status, pair.name)))
    assert see == [("same", "same"), ("different", "other"), ("missing", "gone")]
    assert [outcome.status for outcome in outcomes] == ["same", "different", "missing"]
    assert set(outcomes[1].figures) == set(STRICTNESS_LEVELS[level].limits)


@pytest.mark.parametrize("shape", [(1, 1, 3), (1, 9, 4), (7, 1, 3), (2, 3, 4)])
def test_tiny_pictures(shape: tuple[int, int, int]) -> None:
    golden = np.full(shape, 100, np.uint8)
    for level, by, status in (("exact", 1, "different"), ("cross-driver", 40, "different"), ("exact", 0, "same")):
        outcome = verdict((golden + np.uint8(by)).astype(np.uint8), golden, STRICTNESS_LEVELS[level].limits)
        assert (outcome.status, set(outcome.figures)) == (status, set(STRICTNESS_LEVELS[level].limits))


def test_a_limit_that_a_picture_is_too_small_for() -> None:
    small = noise(1, 8, 8)
    with pytest.raises(InputError, match="too small a picture for mean SSIM"):
        verdict(noise(2, 8, 8), small, {"ssim": 0.5})
    assert verdict(small, small.copy(), {"ssim": 0.5}).status == "same"


def test_packages_are_asked_for_before_the_first_pair(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)

    def pairs() -> object:
        raise AssertionError
        yield

    for rules, package in (
        (Rules(), "flip_evaluator"),
        (Rules("exact", frames={"a.png": {"ssim": 0.9}}), "skimage"),
    ):
        with pytest.raises(InputError, match=f"the package {package} is not installed"):
            compare_pairs(pairs(), rules, lambda outcome, pair: None)  # type: ignore[arg-type]
    assert len(compare_pairs([Pair("a", GREY, GREY)], Rules("exact"), lambda outcome, pair: None)) == 1


@pytest.mark.parametrize(
    ("name", "value", "limit", "text"),
    [
        ("largest", 7.0, 1.0, "largest error of a channel 7 levels, at most 1"),
        ("largest", 1.0, 0.0, "largest error of a channel 1 level, at most 0"),
        ("flip", 0.0123456, 0.001, "mean FLIP 0.0123, at most 0.001"),
        ("flip", 0.00100049, 0.001, "mean FLIP 0.0010005, at most 0.001"),
        ("flip", 0.00099951, 0.001, "mean FLIP 0.001, at most 0.001"),
        ("ssim", 0.97996, 0.98, "mean SSIM 0.97996, at least 0.98"),
        ("ssim", 0.98, 0.98, "mean SSIM 0.98, at least 0.98"),
        ("bias", np.nextafter(0.1, 1), 0.1, "mean signed error of the most shifted channel 0.10000000000000002 levels"),
    ],
)
def test_a_number_is_seen_to_be_over_its_limit(name: str, value: float, limit: float, text: str) -> None:
    assert figure_text(name, float(value), limit).startswith(text)
