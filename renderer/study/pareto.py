"""The price of accuracy: which settings no other one beats, and what lies between them."""

from __future__ import annotations

import math
from collections.abc import Sequence


def pareto_front(costs: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Indices of the points than which no other one is as cheap and as exact (and better in one), by rising cost.

    Of several equal points the first is kept; points with a NaN are never on the front.
    """
    order = sorted(
        (i for i in range(len(costs)) if not (math.isnan(costs[i]) or math.isnan(errors[i]))),
        key=lambda i: (costs[i], errors[i], i),
    )
    front: list[int] = []
    for i in order:
        if not front or errors[i] < errors[front[-1]]:
            front.append(i)
    return front


def cost_at_psnr(psnrs: Sequence[float], costs: Sequence[float], wanted: float) -> float:
    """The cost of reaching a PSNR (dB) on the front of some points, log-linear between its settings.

    The cheapest point's cost where that is exact enough already, infinity where no point is.
    """
    front = pareto_front(costs, [-psnr for psnr in psnrs])
    if not front or psnrs[front[-1]] < wanted:
        return math.inf
    if psnrs[front[0]] >= wanted:
        return costs[front[0]]
    above = next(k for k, i in enumerate(front) if psnrs[i] >= wanted)
    low, high = front[above - 1], front[above]
    part = (wanted - psnrs[low]) / (psnrs[high] - psnrs[low]) if math.isfinite(psnrs[high]) else 1.0
    return float(costs[low] ** (1 - part) * costs[high] ** part)


def find_regressions(values: Sequence[float], *, higher_is_better: bool, least: float) -> list[int]:
    """Where a row of values that should get better gets worse by `least` or more: the indices of the worse ones."""
    sign = 1.0 if higher_is_better else -1.0
    return [i for i in range(1, len(values)) if sign * (values[i - 1] - values[i]) >= least]
