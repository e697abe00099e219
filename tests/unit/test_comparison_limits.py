"""Levels of strictness: which figures are over their limits, and how far."""

from __future__ import annotations

import itertools
import math

import pytest

from renderer.study import COMPARISON_METRICS, STRICTNESS_LEVELS, exceeded_limits, severity


def test_levels_limit_figures_that_there_are() -> None:
    assert list(STRICTNESS_LEVELS) == ["exact", "same-machine", "cross-driver"]
    for name, level in STRICTNESS_LEVELS.items():
        assert level.name == name
        assert set(level.limits) <= set(COMPARISON_METRICS)
        assert all(math.isfinite(limit) and limit >= 0 for limit in level.limits.values())


def test_a_level_lets_pass_what_stricter_ones_do() -> None:
    for strict, loose in itertools.pairwise(STRICTNESS_LEVELS.values()):
        limits = {name: limit for name, limit in loose.limits.items() if name in strict.limits}
        assert all(COMPARISON_METRICS[name].passes(strict.limits[name], limit) for name, limit in limits.items())


def test_exceeded_are_the_figures_over_their_limits_in_order() -> None:
    limits = {"bias": 0.1, "largest": 4.0, "ssim": 0.9, "p99": 1.0}
    assert exceeded_limits({"bias": 0.2, "ssim": 0.8, "p99": 1.0, "largest": 5.0}, limits) == [
        "largest",
        "ssim",
        "bias",
    ]
    assert exceeded_limits({"bias": 0.1, "ssim": 0.9, "p99": 1.0, "largest": 4.0}, limits) == []


def test_figures_without_a_limit_and_limits_without_a_figure_exceed_nothing() -> None:
    assert exceeded_limits({"largest": 200.0}, {"p99": 0.0}) == []
    assert exceeded_limits({}, {"largest": 0.0}) == []
    assert severity({"largest": 200.0}, {"p99": 0.0}) == 0.0
    assert severity({}, {}) == 0.0


def test_what_is_not_a_number_is_over_every_limit() -> None:
    assert exceeded_limits({"flip": math.nan}, {"flip": 1.0}) == ["flip"]


@pytest.mark.parametrize(
    ("figures", "limits", "times"),
    [
        ({"largest": 6.0}, {"largest": 4.0}, 1.5),
        ({"largest": 4.0}, {"largest": 4.0}, 1.0),
        ({"largest": 0.0}, {"largest": 4.0}, 0.0),
        ({"largest": 0.0}, {"largest": 0.0}, 0.0),
        ({"largest": 1.0}, {"largest": 0.0}, 2.0),
        ({"largest": 241.0, "densest": 3.0}, {"largest": 0.0, "densest": 0.1}, 242.0),
        ({"p99": 1.0, "largest": 30.0}, {"p99": 0.0, "largest": 1.0}, 30.0),
        ({"flip": 0.02}, {"flip": 0.0}, 3.0),
        ({"ssim": 0.7}, {"ssim": 0.9}, 3.0),
        ({"ssim": 1.0}, {"ssim": 1.0}, 0.0),
        ({"ssim": 0.9}, {"ssim": 1.0}, 11.0),
        ({"largest": 2.0, "bias": 0.3}, {"largest": 4.0, "bias": 0.1}, 3.0),
    ],
)
def test_severity_is_how_many_times_over_its_limit_the_worst_figure_is(
    figures: dict[str, float], limits: dict[str, float], times: float
) -> None:
    assert severity(figures, limits) == pytest.approx(times)
