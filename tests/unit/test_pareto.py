"""Tests of Pareto fronts, of costs between settings, and of regressions."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hsplat_cli.measure import cost_at_psnr, pareto_front


@pytest.mark.parametrize("seed", range(40))
def test_nothing_beats_the_front_and_something_beats_the_rest(seed: int) -> None:
    """Points lie on a small grid, so that some are equal, and some are undefined."""
    rng = np.random.default_rng(seed)
    grid = np.array([0.0, 1.0, 2.0, 3.0, 4.0, math.nan])
    points = [(float(cost), float(error)) for cost, error in rng.choice(grid, (seed % 13, 2))]
    front = pareto_front([cost for cost, _ in points], [error for _, error in points])
    whole = [i for i, point in enumerate(points) if not any(map(math.isnan, point))]

    def beats(i: int, j: int) -> bool:
        return all(a <= b for a, b in zip(points[i], points[j], strict=True)) and points[i] != points[j]

    assert set(front) <= set(whole)
    assert not any(beats(i, j) for i in whole for j in front)
    kept = {points[j] for j in front}
    assert all(points[i] in kept or any(beats(j, i) for j in front) for i in whole)
    assert len(kept) == len(front)
    assert [points[i][0] for i in front] == sorted(points[i][0] for i in front)


def test_the_cost_between_two_settings_is_log_linear() -> None:
    psnrs, costs = [30.0, 40.0, 35.0], [1.0, 100.0, 500.0]  # the last one is beaten
    assert cost_at_psnr(psnrs, costs, 35.0).value == pytest.approx(10.0)
    assert cost_at_psnr(psnrs, costs, 40.0) == (100.0, False)
    assert cost_at_psnr(psnrs, costs, 30.0) == (1.0, False)
    assert cost_at_psnr(psnrs, costs, 20.0) == (1.0, True)
    assert cost_at_psnr(psnrs, costs, 41.0) == (math.inf, False)
    assert cost_at_psnr([], [], 30.0) == (math.inf, False)
    assert cost_at_psnr([30.0, math.inf], [1.0, 7.0], 60.0) == (7.0, False)
