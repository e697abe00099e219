"""Finds the settings that no other setting beats in both accuracy and cost, and interpolates between them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple


class Cost(NamedTuple):
    """Holds the cost at which a PSNR is reached; infinite if no setting reaches it.

    is_bound: whether the cheapest measured setting is already more exact, so that the true cost may be lower.
    """

    value: float
    is_bound: bool = False


def pareto_front(costs: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Return the indices of the points on the Pareto front: no other point has both a lower cost and a lower error.

    The indices are sorted by rising cost. The first of equal points is kept; a point with a NaN is never on the front.
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


def cost_at_psnr(psnrs: Sequence[float], costs: Sequence[float], wanted: float) -> Cost:
    """Return the cost of reaching a PSNR (dB) on the Pareto front of measured points.

    Between two points of the front, the logarithm of the cost is linear in the PSNR.
    """
    front = pareto_front(costs, [-psnr for psnr in psnrs])
    if not front or psnrs[front[-1]] < wanted:
        return Cost(math.inf)
    if psnrs[front[0]] >= wanted:
        return Cost(costs[front[0]], is_bound=psnrs[front[0]] > wanted)
    above = next(k for k, i in enumerate(front) if psnrs[i] >= wanted)
    low, high = front[above - 1], front[above]
    part = (wanted - psnrs[low]) / (psnrs[high] - psnrs[low]) if math.isfinite(psnrs[high]) else 1.0
    return Cost(costs[low] ** (1 - part) * costs[high] ** part)
