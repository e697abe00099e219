"""The finest cut that can be drawn in a given time: details by size, trial drawings, and a pacer for a film.

A detail stays while its frames keep to their time: a film that changed its cut from frame to frame would flicker.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from renderer.frame.costs import CostLog, Workload, workload_of
from renderer.frame.frame import (
    UPLOAD_STAGE,
    Clock,
    DrawList,
    Rasterizer,
    Stage,
    Stopwatch,
    draw_frame,
    make_draw_list,
    make_lod,
    make_primitive,
)
from renderer.frame.primitives import LOD
from renderer.scene import tolerance_at

# How many trial drawings there are at least: of one size alone they would not tell splats from pixels.
_FEWEST_TRIALS = 3

# A detail is looked for that takes this part of its time, give or take, in so many tries.
_TARGET_SHARE, _TARGET_DEVIATION, _MOST_TRIES = 0.95, 0.04, 5
# It is kept while it is predicted to take from and up to these parts of its time or, where none could be found that
# does, about what it was predicted to take when it was chosen.
_KEEP_FROM_SHARE, _KEEP_TO_SHARE, _MAX_DRIFT = 0.84, 1.09, 0.1
# Before so many frames after the first one tell what it takes, it is not given up, unless it is predicted to take less
# or more than these parts of its time; for more, by two frames at least, for the first may have been hindered.
_FEWEST_FRAMES, _FAR_TOO_SHORT, _FAR_TOO_LONG = 3, 0.4, 1.5
# Where a detail is predicted to take f times its time, the next one is at most f^_SIZE_EXPONENT times as large or as
# small, within the family's bounds: with 2.5 one goes twice as far at 1.3 times the time, and 16 times, the most, at 3
# times.
_SIZE_EXPONENT = 2.5

# Seconds grow with these powers of the size, a number of cells: of few large cells the pixels cost, of many small ones
# the splats. Beyond the largest one seen, and from the detail of the frame before, one goes so far at once: a little
# less time is a thousand times fewer large cells.
_LEAST_POWER, _MOST_POWER = 0.1, 1.0
_ANY_SIZE = 0.0, math.inf

# What passes between the start of a frame and the next one but is not drawing it.
CUT_STAGES = ("cut", "splats", "edges", "order")


class LODCostEstimator:
    """Details of a stage by their size, and what a frame of them takes."""

    def __init__(self, stage: Stage, log: CostLog) -> None:
        self.stage, self.log, self.primitive = stage, log, make_primitive(stage)
        self._seen: dict[float, Workload] = {}  # by size

    def size(self, lod: LOD) -> float:
        """What its family calls its size."""
        return self.primitive.lod_size(lod.tolerance, lod.num_cells)

    def make_draw_list(self, number: int, tolerance: float, watch: Stopwatch) -> DrawList:
        """A frame of the detail of a tolerance."""
        return make_draw_list(self.stage, self.primitive.make_lod(tolerance, watch.lap), number, watch)

    def predict(self, draw_list: DrawList, *, last: int = 0) -> float:
        """Seconds of a frame whose detail is made, until it is in its file; `last` as in CostLog."""
        load = workload_of(draw_list)
        self._seen[self.size(draw_list.lod)] = load
        return self.log.predict(load, last=last) + draw_list.order_seconds

    def record_frame(self, draw_list: DrawList, watch: Stopwatch, *, is_first: bool = False) -> None:
        """A frame has been drawn and, at this moment, taken care of.

        is_first: of several of its detail: what it did for the others, too, tells nothing of them.
        """
        watch.lap("written")
        others = (*CUT_STAGES, UPLOAD_STAGE) if is_first else CUT_STAGES
        self.log.add(
            workload_of(draw_list), sum(seconds for name, seconds in watch.seconds.items() if name not in others)
        )

    def size_for_seconds(self, seconds: float, *, last: int = 0) -> float:
        """The size that a frame may have that is to take so long, by the frames that were predicted so far.

        Seconds are taken for a power of the size, that of the two sizes around or nearest. `last` as in CostLog.
        """
        sizes = np.log(sorted(self._seen))
        costs = np.log(
            np.maximum.accumulate([self.log.predict(load, last=last) for _, load in sorted(self._seen.items())])
        )
        wanted, power = math.log(seconds), _MOST_POWER
        near = min(int(np.count_nonzero(costs < wanted)), len(sizes) - 1)
        if len(sizes) > 1:
            above = max(near, 1)
            power = (costs[above] - costs[above - 1]) / (sizes[above] - sizes[above - 1])
        power = min(max(power, _LEAST_POWER), _MOST_POWER)
        found = sizes[near] + min((wanted - costs[near]) / power, math.log(self.primitive.size_ratio))
        if near > 0:
            found = max(found, sizes[near - 1])
        return math.exp(found)


def calibrate_costs(
    estimator: LODCostEstimator,
    number: int,
    min_last_seconds: float,
    rasterizer: Rasterizer,
    *,
    clock: Clock,
    first_size: float | None = None,
    on_step: Callable[[], None] = lambda: None,
) -> None:
    """Draw a frame at larger and larger sizes, to learn what drawing costs, until one takes `min_last_seconds`.

    first_size: one at which a frame shows what it is, unless it is given.
    on_step: called before each drawing; what it raises goes through.
    """
    primitive = estimator.primitive
    size = primitive.initial_size if first_size is None else first_size
    tolerance, before, num_trials = primitive.tolerance_for_size(size), math.inf, 0
    while tolerance < before:
        on_step()
        draw_list = estimator.make_draw_list(number, tolerance, Stopwatch(clock))
        if estimator.log.is_empty:  # shaders are compiled, and buffers made
            draw_frame(estimator.stage, draw_list, rasterizer, Stopwatch(clock))
        watch = Stopwatch(clock)
        draw_frame(estimator.stage, draw_list, rasterizer, watch)
        seconds = sum(watch.seconds.values()) - watch.seconds.get(UPLOAD_STAGE, 0.0)
        estimator.log.add(workload_of(draw_list, is_written=False), seconds)
        estimator.predict(draw_list)
        num_trials += 1
        if seconds >= min_last_seconds and num_trials >= _FEWEST_TRIALS:
            return
        size *= primitive.size_ratio
        tolerance, before = primitive.tolerance_for_size(size), tolerance


def find_finest_in_time(
    estimator: LODCostEstimator,
    number: int,
    seconds: float,
    watch: Stopwatch,
    *,
    sizes: tuple[float, float] = _ANY_SIZE,
    last: int = 0,
) -> tuple[DrawList, float]:
    """A frame that is predicted to take nearly so many seconds, or less where it shows every voxel; and what it takes.

    Where even a single cell takes longer, the quickest one found. Frames have been predicted before.
    sizes: the smallest and the largest one that it may have. last: as in CostLog.
    """
    aim = _TARGET_SHARE * seconds
    best: tuple[DrawList, float] | None = None
    tried: set[float] = set()
    for _ in range(_MOST_TRIES):
        wanted = min(max(estimator.size_for_seconds(aim, last=last), sizes[0]), sizes[1])
        tolerance = estimator.primitive.tolerance_for_size(wanted)
        if tolerance in tried:
            break
        tried.add(tolerance)
        draw_list = estimator.make_draw_list(number, tolerance, watch)
        predicted = estimator.predict(draw_list, last=last)
        if best is None or _badness(predicted, seconds) < _badness(best[1], seconds):
            best = draw_list, predicted
        if abs(predicted - aim) <= _TARGET_DEVIATION * aim:
            break
    assert best is not None
    return best


def _badness(predicted: float, seconds: float) -> tuple[bool, float]:
    """How far a frame is from the time that it is to take, smaller being better; too long is worse than too short."""
    is_too_long = predicted > _KEEP_TO_SHARE * seconds
    return is_too_long, predicted if is_too_long else abs(math.log(predicted / (_TARGET_SHARE * seconds)))


class ToleranceController(Protocol):
    """Decides, frame by frame, at which tolerance the film is drawn."""

    def prepare_frame(self, number: int, watch: Stopwatch) -> tuple[DrawList, float | None]:
        """The frame to be drawn, and what it is predicted to take from its start until the next one is asked for."""

    def finish_frame(self, draw_list: DrawList, watch: Stopwatch) -> None:
        """The frame has been drawn and, at this moment, taken care of."""


class ScheduleController:
    """Follows the schedule of the stage's scene; a detail is used again while the tolerance stays.

    details: told what frames take, and asked what they will take.
    """

    def __init__(self, stage: Stage, estimator: LODCostEstimator | None = None) -> None:
        self._stage, self._estimator = stage, estimator
        self._lod: LOD | None = None

    def prepare_frame(self, number: int, watch: Stopwatch) -> tuple[DrawList, float | None]:
        """As in Guide."""
        tolerance = tolerance_at(self._stage.scene.error, number)
        if self._lod is None or self._lod.tolerance != tolerance:
            self._lod = None  # let go of the old one first
            self._lod = make_lod(self._stage, tolerance, watch)
        draw_list = make_draw_list(self._stage, self._lod, number, watch)
        return draw_list, self._estimator.predict(draw_list) if self._estimator else None

    def finish_frame(self, draw_list: DrawList, watch: Stopwatch) -> None:
        """As in Guide."""
        if self._estimator:
            self._estimator.record_frame(draw_list, watch)


class BudgetController:
    """Finds, frame by frame, what can be drawn in time.

    seconds_of: the time of a frame.
    """

    def __init__(self, estimator: LODCostEstimator, seconds_of: Callable[[int], float]) -> None:
        self._estimator, self._seconds_of = estimator, seconds_of
        self._current_lod: _CurrentLOD | None = None

    def prepare_frame(self, number: int, watch: Stopwatch) -> tuple[DrawList, float | None]:
        """As in Guide."""
        if self._current_lod is None:
            return self.choose(number, watch)
        seconds = self._seconds_of(number)
        draw_list = make_draw_list(self._estimator.stage, self._current_lod.lod, number, watch)
        last = self._current_lod.num_frames  # all of this detail
        predicted = self._estimator.predict(draw_list, last=last)
        self._current_lod.update_share(predicted / seconds)
        if self._keeps_lod(predicted, seconds):
            return draw_list, predicted
        if predicted >= _FAR_TOO_SHORT * seconds:
            last = 0
            # A hiccup, or a speed that is no more, makes them disagree: then there is no telling where to go.
            if (predicted > seconds) != (self._estimator.predict(draw_list) > seconds):
                return draw_list, predicted
        sizes = self._sizes_after(predicted / seconds) if seconds == self._current_lod.seconds else _ANY_SIZE
        del draw_list  # let go of the old ones first
        self._current_lod = None
        return self.choose(number, watch, sizes=sizes, last=last)

    def choose(
        self, number: int, watch: Stopwatch, *, sizes: tuple[float, float] = _ANY_SIZE, last: int = 0
    ) -> tuple[DrawList, float]:
        """Find a detail for a frame and those that follow; of the first one, best before its time begins.

        sizes, last: as in `find_finest_in_time`.
        """
        seconds = self._seconds_of(number)
        draw_list, predicted = find_finest_in_time(self._estimator, number, seconds, watch, sizes=sizes, last=last)
        wanted = max(1.0, self._estimator.size_for_seconds(_TARGET_SHARE * seconds, last=last))
        is_intermediate = not sizes[0] <= wanted <= sizes[1]
        self._current_lod = _CurrentLOD(draw_list.lod, predicted / seconds, seconds, is_intermediate)
        return draw_list, predicted

    def finish_frame(self, draw_list: DrawList, watch: Stopwatch) -> None:
        """As in Guide."""
        assert self._current_lod is not None
        self._estimator.record_frame(draw_list, watch, is_first=self._current_lod.num_frames == 0)
        self._current_lod.num_frames += 1

    def _sizes_after(self, share: float) -> tuple[float, float]:
        """Those that the next detail may have, where the one that was chosen takes this part of its time."""
        assert self._current_lod is not None
        primitive, size = self._estimator.primitive, self._estimator.size(self._current_lod.lod)
        reach = min(
            max(primitive.small_size_ratio, share**_SIZE_EXPONENT, share**-_SIZE_EXPONENT), primitive.size_ratio
        )
        return size / reach, size * reach

    def _keeps_lod(self, predicted: float, seconds: float) -> bool:
        """Whether the detail stays that was chosen, now that a frame of it is predicted to take so long."""
        assert self._current_lod is not None
        share, chosen_share = predicted / seconds, self._current_lod.share
        if share < 1 and self._current_lod.lod.tolerance == 0:
            return True
        least, most = _FAR_TOO_SHORT * min(1, chosen_share), _FAR_TOO_LONG * max(1, chosen_share)
        num_frames = self._current_lod.num_frames if seconds == self._current_lod.seconds else _FEWEST_FRAMES + 1
        if self._current_lod.is_intermediate:
            return num_frames <= 1 and share >= _FAR_TOO_SHORT
        if share >= least and (num_frames <= 1 or (num_frames <= _FEWEST_FRAMES and share < most)):
            return True
        if not _KEEP_FROM_SHARE <= chosen_share <= _KEEP_TO_SHARE:  # there was none nearer, and there will be none now
            return abs(share / chosen_share - 1) < _MAX_DRIFT
        return _KEEP_FROM_SHARE <= share <= _KEEP_TO_SHARE


@dataclass
class _CurrentLOD:
    """share: of its time that the detail was predicted to take. num_frames: drawn so far.

    is_intermediate: another one, too far away to go there at once, was predicted to be nearer to that time.
    """

    lod: LOD
    share: float
    seconds: float
    is_intermediate: bool
    num_frames: int = 0

    def update_share(self, share: float) -> None:
        """It turns out to take this part of its time: perhaps one need not go further."""
        if self.is_intermediate and abs(share / _TARGET_SHARE - 1) <= _MAX_DRIFT:
            self.share, self.is_intermediate = share, False
