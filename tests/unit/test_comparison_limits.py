"""The limits of the strictnesses, and how far metrics exceed them."""

from __future__ import annotations

import itertools
import math

import pytest

from hsplat_cli.compare import COMPARISON_METRICS, STRICTNESSES, exceeded_limits, severity


def test_a_level_accepts_what_stricter_ones_accept() -> None:
    for strict, loose in itertools.pairwise(STRICTNESSES.values()):
        limits = {name: limit for name, limit in loose.limits.items() if name in strict.limits}
        assert all(COMPARISON_METRICS[name].passes(strict.limits[name], limit) for name, limit in limits.items())


@pytest.mark.parametrize(
    ("values", "exceeded"),
    [
        ({"bias": 0.2, "ssim": 0.8, "p99": 1.0, "largest": 5.0}, ["largest", "ssim", "bias"]),
        ({"bias": 0.1, "ssim": 0.9, "p99": 1.0, "largest": 4.0}, []),
        ({"flip": 200.0}, []),
        ({"bias": math.nan}, ["bias"]),
        ({}, []),
    ],
)
def test_exceeded_limits_are_in_the_order_of_the_metrics(values: dict[str, float], exceeded: list[str]) -> None:
    assert exceeded_limits(values, {"bias": 0.1, "largest": 4.0, "ssim": 0.9, "p99": 1.0}) == exceeded


@pytest.mark.parametrize(
    ("figures", "limits", "times"),
    [
        ({"largest": 6.0}, {"largest": 4.0}, 1.5), ({"largest": 4.0}, {"largest": 4.0}, 1.0),
        ({"largest": 0.0}, {"largest": 4.0}, 0.0), ({"largest": 0.0}, {"largest": 0.0}, 0.0),
        ({"largest": 1.0}, {"largest": 0.0}, 2.0),
        ({"largest": 241.0, "densest": 3.0}, {"largest": 0.0, "densest": 0.1}, 242.0),
        ({"p99": 1.0, "largest": 30.0}, {"p99": 0.0, "largest": 1.0}, 30.0), ({"flip": 0.02}, {"flip": 0.0}, 3.0),
        ({"ssim": 0.7}, {"ssim": 0.9}, 3.0), ({"ssim": 1.0}, {"ssim": 1.0}, 0.0), ({"ssim": 0.9}, {"ssim": 1.0}, 11.0),
        ({"largest": 2.0, "bias": 0.3}, {"largest": 4.0, "bias": 0.1}, 3.0),
    ],
)  # fmt: skip
def test_severity_is_the_largest_ratio_of_an_error_to_its_limit(figures, limits, times) -> None:
    assert severity(figures, limits) == pytest.approx(times)
