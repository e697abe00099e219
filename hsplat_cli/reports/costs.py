"""What an accuracy costs: the settings that no other one beats, and the price of a PSNR on their front."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from renderer.study import Measurement, Setting, cost_at_psnr, pareto_front

OWN = "hsplat"
PEER = "vtk"

# Rows of the table of prices: every so many dB, from the first on or, where nothing is so exact, from below it.
_FIRST_DB = 25
_STEP_DB = 5


def program_of(measurement: Measurement) -> str:
    """The program that drew the pictures: OWN or PEER."""
    return str(measurement.setting.options.get("tool", OWN))


def has_bricks(measurements: Sequence[Measurement]) -> bool:
    """Whether any of them draws bricks, which `num_cells` counts then."""
    return any(m.setting.options.get("footprint") == "integrated" for m in measurements)


def has_splats(measurements: Sequence[Measurement]) -> bool:
    """Whether any of them draws splats, a cell each."""
    return any(m.num_splats is not None for m in measurements)


def cells_title(measurements: Sequence[Measurement]) -> str:
    """What a column of `num_cells` counts: `cells`, `bricks`, or `bricks or cells` by the footprint of the row."""
    if not has_bricks(measurements):
        return "cells"
    return "bricks or cells" if has_splats(measurements) else "bricks"


def group_by_series(measurements: Sequence[Measurement]) -> dict[str, list[int]]:
    """Numbers of the measurements of each series, series and members in the order in which they come."""
    members: dict[str, list[int]] = {}
    for number, measurement in enumerate(measurements):
        members.setdefault(measurement.setting.series, []).append(number)
    return members


def time_front(measurements: Sequence[Measurement], tool: str) -> list[int]:
    """Those of a tool than which no other one of the same tool is as fast and has as high a PSNR, by rising time."""
    return _front(measurements, [m.frame_seconds if program_of(m) == tool else math.nan for m in measurements])


def splats_front(measurements: Sequence[Measurement]) -> list[int]:
    """Those than which no other one has as few splats and as high a PSNR, by rising number of splats."""
    return _front(measurements, [math.nan if m.num_splats is None else m.num_splats for m in measurements])


def pareto_fronts(measurements: Sequence[Measurement]) -> tuple[frozenset[int], frozenset[int]]:
    """Numbers of the measurements on the Pareto front of time, each tool having its own, and on that of splats."""
    time = frozenset(time_front(measurements, OWN)) | frozenset(time_front(measurements, PEER))
    return time, frozenset(splats_front(measurements))


def _front(measurements: Sequence[Measurement], costs: Sequence[float]) -> list[int]:
    return pareto_front(costs, [-m.overall.everywhere.psnr for m in measurements])


@dataclass(frozen=True)
class Cost:
    """Of reaching a PSNR: infinite where it is not reached; `is_bound` where the cheapest setting that was measured is
    more exact already, so that it may cost less."""

    value: float
    is_bound: bool


@dataclass(frozen=True)
class CostAtPsnr:
    """What a PSNR (dB) costs: time of a frame (s) and splats, interpolated on the front; `setting` is the fastest of
    those measured that reach it; `peer` the peer's time. splats, peer: None where nothing with them was measured."""

    psnr: float
    time: Cost
    splats: Cost | None
    setting: Setting | None
    peer: Cost | None

    @property
    def ratio(self) -> float:
        """How many times as long as hsplat the peer takes; NaN where one does not reach it, or both only bound it."""
        if self.peer is None or not (math.isfinite(self.peer.value) and math.isfinite(self.time.value)):
            return math.nan
        return math.nan if self.peer.is_bound and self.time.is_bound else self.peer.value / self.time.value


def prices(measurements: Sequence[Measurement]) -> list[CostAtPsnr]:
    """One for every 5 dB as far as anything that was measured reaches."""
    own = [m for m in measurements if program_of(m) == OWN]
    peers = [m for m in measurements if program_of(m) == PEER]
    return [_cost_at_psnr(float(psnr), own, peers) for psnr in _levels(measurements)]


def _levels(measurements: Sequence[Measurement]) -> range:
    reached = [m.overall.everywhere.psnr for m in measurements if math.isfinite(m.overall.everywhere.psnr)]
    if not reached:
        return range(0)
    highest = math.floor(max(reached) / _STEP_DB) * _STEP_DB
    return range(min(_FIRST_DB, highest), highest + 1, _STEP_DB)


def _cost_at_psnr(wanted: float, own: Sequence[Measurement], peers: Sequence[Measurement]) -> CostAtPsnr:
    with_splats = [(m, m.num_splats) for m in own if m.num_splats is not None]
    enough = [m for m in own if m.overall.everywhere.psnr >= wanted]
    return CostAtPsnr(
        wanted,
        _cost(own, [m.frame_seconds for m in own], wanted),
        _cost([m for m, _ in with_splats], [count for _, count in with_splats], wanted) if with_splats else None,
        min(enough, key=lambda m: m.frame_seconds).setting if enough else None,
        _cost(peers, [m.frame_seconds for m in peers], wanted) if peers else None,
    )


def _cost(measurements: Sequence[Measurement], costs: Sequence[float], wanted: float) -> Cost:
    psnrs = [m.overall.everywhere.psnr for m in measurements]
    front = _front(measurements, costs)
    return Cost(cost_at_psnr(psnrs, costs, wanted), bool(front) and psnrs[front[0]] > wanted)
