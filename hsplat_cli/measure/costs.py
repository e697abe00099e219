"""Finds the Pareto fronts of a study, and the cost of a PSNR on them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from hsplat_cli.measure.pareto import Cost, cost_at_psnr, pareto_front
from hsplat_cli.measure.sweep import Measurement, Setting

# A function that returns the cost of a measurement, such as seconds or splats.
CostOf = Callable[[Measurement], float]

# PSNR of the first row of the table of costs, in dB; the table begins lower if no measurement reaches it.
_FIRST_DB = 25
# Step of PSNR between two rows of the table of costs, in dB.
_STEP_DB = 5


def has_bricks(measurements: Sequence[Measurement]) -> bool:
    """Return whether any setting draws bricks, so that `num_cells` of its measurement is a number of bricks."""
    return any(m.setting.options.get("footprint") == "integrated" for m in measurements)


def cost_in_splats(measurement: Measurement) -> float:
    """Return the mean number of splats of a frame; NaN for bricks, each of which is far more work than a splat."""
    return math.nan if has_bricks([measurement]) else measurement.num_primitives


def has_splats(measurements: Sequence[Measurement]) -> bool:
    """Return whether any setting draws splats."""
    return not all(math.isnan(cost_in_splats(m)) for m in measurements)


def group_by_series(measurements: Sequence[Measurement]) -> dict[str, list[int]]:
    """Return the indices of the measurements of each series of settings that differ only in their tolerances."""
    members: dict[str, list[int]] = {}
    for number, measurement in enumerate(measurements):
        members.setdefault(measurement.setting.series, []).append(number)
    return members


def cost_in_time(measurement: Measurement) -> float:
    """Return the median time of a frame, in seconds."""
    return measurement.frame_seconds


def front_of(measurements: Sequence[Measurement], cost: CostOf) -> list[int]:
    """Return the indices of the measurements on the Pareto front of a cost and PSNR, by rising cost."""
    return pareto_front([cost(m) for m in measurements], [-m.overall.everywhere["psnr"] for m in measurements])


def on_pareto_fronts(measurements: Sequence[Measurement]) -> list[tuple[bool, bool]]:
    """Return for each measurement whether it is on the Pareto front of time and PSNR, and of splats and PSNR."""
    time, splats = (set(front_of(measurements, cost)) for cost in (cost_in_time, cost_in_splats))
    return [(i in time, i in splats) for i in range(len(measurements))]


@dataclass(frozen=True)
class CostAtPsnr:
    """Holds the cost of reaching a PSNR, interpolated on the Pareto fronts.

    psnr: in dB. time: seconds of a frame. splats: number of splats of a frame; None without measurements of splats.
    setting: the fastest measured setting that reaches the PSNR.
    """

    psnr: float
    time: Cost
    splats: Cost | None
    setting: Setting | None


def costs_by_psnr(measurements: Sequence[Measurement]) -> list[CostAtPsnr]:
    """Return the cost of every multiple of 5 dB, up to the highest PSNR measured."""
    return [_cost_at_psnr(float(psnr), measurements) for psnr in _wanted_psnrs(measurements)]


def _wanted_psnrs(measurements: Sequence[Measurement]) -> range:
    reached = [m.overall.everywhere["psnr"] for m in measurements if math.isfinite(m.overall.everywhere["psnr"])]
    if not reached:
        return range(0)
    highest = math.floor(max(reached) / _STEP_DB) * _STEP_DB
    return range(min(_FIRST_DB, highest), highest + 1, _STEP_DB)


def _cost_at_psnr(wanted: float, measurements: Sequence[Measurement]) -> CostAtPsnr:
    enough = [m for m in measurements if m.overall.everywhere["psnr"] >= wanted]
    return CostAtPsnr(
        wanted,
        _cost(measurements, cost_in_time, wanted),
        _cost(measurements, cost_in_splats, wanted) if has_splats(measurements) else None,
        min(enough, key=cost_in_time).setting if enough else None,
    )


def _cost(measurements: Sequence[Measurement], cost: CostOf, wanted: float) -> Cost:
    return cost_at_psnr([m.overall.everywhere["psnr"] for m in measurements], [cost(m) for m in measurements], wanted)
