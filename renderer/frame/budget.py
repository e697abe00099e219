"""Choose the tolerance of each frame: by the scene's schedule, or by a budget of time.

The time to draw a frame is modelled by rates that are fitted to the frames drawn so far:

    seconds = per_frame + per_splat * splats + per_pixel * pixels + per_written, for a frame that goes into a file

`pixels` are those that the rasteriser visits: around each footprint, or samples along rays through bricks. With a
budget of time, trial frames of rising size calibrate the rates, and the finest level of detail (LOD) is chosen that is
predicted to be drawn in time. It stays while its frames keep to their time, because a film whose cut changed from frame
to frame would flicker.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from renderer.frame.frame import UPLOAD_STAGE, DrawList, Rasterizer, draw_frame, make_draw_list
from renderer.frame.primitives import LOD, make_primitive
from renderer.frame.stage import Clock, Stage, Stopwatch
from renderer.scene import tolerance_at

Float64 = npt.NDArray[np.float64]

# Seconds per frame, splat, pixel and written frame of a software renderer on two cores.
_TYPICAL_RATES = np.array([5e-3, 1e-6, 8e-9, 2e-3])
# No frame counts as quicker than this part of its typical time: one for which the clock stood still must not outweigh
# the others.
_MIN_RELATIVE_PACE = 1e-3
# Weight of a rate that is off by its own size, against a frame that is.
_PRIOR_WEIGHT = 1e-4
# How many of the film's last frames the model is fitted to, and how many tell the machine's present speed.
_NUM_REMEMBERED, _NUM_RECENT = 16, 7

# Trial drawings of a single size would not tell splats from pixels.
_MIN_TRIALS = 3

# The search for an LOD aims at this part of the time, with this relative deviation, in at most so many tries.
_TARGET_SHARE, _TARGET_DEVIATION, _MAX_TRIES = 0.95, 0.04, 5
# An LOD stays while it is predicted to take from and up to these parts of its time. If none was found that does, it
# stays while the prediction drifts by less than _MAX_DRIFT.
_KEEP_FROM_SHARE, _KEEP_TO_SHARE, _MAX_DRIFT = 0.84, 1.09, 0.1
# An LOD is not given up before it has drawn so many frames after the first, unless it is predicted to take less or more
# than these parts of its time. For more, two frames are needed, because the first may have been hindered.
_MIN_FRAMES, _FAR_TOO_SHORT, _FAR_TOO_LONG = 3, 0.4, 1.5
# If an LOD is predicted to take f times its time, the size changes at most by the factor f^_SIZE_EXPONENT, within the
# primitive's bounds: with 2.5, by 2 at 1.3 times the time, and by 16, the most, at 3 times.
_SIZE_EXPONENT = 2.5

# Seconds grow with a power of the size between these: a few large cells cost their pixels, many small ones their
# number. A little less time is a thousand times fewer large cells, so that steps from the sizes seen are bounded, too.
_MIN_POWER, _MAX_POWER = 0.1, 1.0
_ANY_SIZE = 0.0, math.inf

# Stages of a frame that are not drawing.
_CUT_STAGES = ("cut", "splats", "edges", "order")


class Workload(NamedTuple):
    """What a frame draws: splats or bricks; pixels or samples; 1 if the frame goes into a file, else 0."""

    num_splats: float
    num_pixels: float
    num_written: int


def workload_of(draw_list: DrawList, *, is_written: bool = True) -> Workload:
    """Return what a frame draws, in all its orders."""
    return Workload(*draw_list.lod.workload(draw_list.orders, draw_list.view), int(is_written))


@dataclass(frozen=True)
class CostModel:
    """Seconds per frame, splat, pixel and written frame."""

    per_frame: float
    per_splat: float
    per_pixel: float
    per_written: float

    def seconds(self, load: Workload) -> float:
        """Return the time to draw a frame, without its cut and order."""
        drawn = self.per_frame + self.per_splat * load.num_splats + self.per_pixel * load.num_pixels
        return drawn + self.per_written * load.num_written


def fit_costs(samples: list[tuple[Workload, float]]) -> CostModel:
    """Return the rates >= 0 with the least squared relative errors; `samples` are workloads and their seconds.

    Rates that the samples leave open are those of a typical machine, scaled to the speed of this one.
    """
    amounts = np.array([(1.0, *load) for load, _ in samples]).reshape(-1, 4) * _TYPICAL_RATES
    typical = amounts.sum(axis=1)  # seconds
    paces = np.array([taken for _, taken in samples]) / typical
    speed = (float(np.median(paces)) or 1.0) if samples else 1.0
    paces = np.maximum(paces, _MIN_RELATIVE_PACE * speed)
    # Unknowns are in units of the typical rates, and a weak equation for each draws it to 1.
    shares = amounts * (speed / (typical * paces))[:, None]
    matrix = shares.T @ shares + _PRIOR_WEIGHT * np.eye(4)
    rates = _least_squares(matrix, shares.sum(axis=0) + _PRIOR_WEIGHT)
    return CostModel(*(rates * speed * _TYPICAL_RATES).tolist())


def _least_squares(matrix: Float64, wanted: Float64) -> Float64:
    """Return the x >= 0 that minimises `x matrix x - 2 wanted x`; matrix [n, n] is positive definite, and n small.

    Solves without the bound for every subset of the unknowns, the others being 0, and takes the best valid solution.
    """
    best, least = np.zeros(len(wanted)), 0.0
    for chosen in product((True, False), repeat=len(wanted)):
        some = np.flatnonzero(chosen)
        x = np.linalg.solve(matrix[np.ix_(some, some)], wanted[some])
        least_objective = -float(wanted[some] @ x)  # the objective at its minimum
        if x.min(initial=0.0) >= 0 and least_objective < least:
            best, least = np.zeros(len(wanted)), least_objective
            best[some] = x
            if all(chosen):
                break
    return best


class CostLog:
    """The frames drawn so far, from which the cost of the next ones is predicted."""

    def __init__(self) -> None:
        self._trials: list[tuple[Workload, float]] = []
        self._frames: deque[tuple[Workload, float]] = deque(maxlen=_NUM_REMEMBERED)
        self._model: CostModel | None = None

    @property
    def is_empty(self) -> bool:
        """Whether nothing was drawn yet."""
        return not (self._trials or self._frames)

    def add(self, load: Workload, seconds: float) -> None:
        """Record a frame: one of the film if it was written, else a trial."""
        (self._frames if load.num_written else self._trials).append((load, seconds))
        self._model = None

    @property
    def model(self) -> CostModel:
        """The model fitted to the trials and the last frames."""
        if self._model is None:
            self._model = fit_costs([*self._trials, *self._frames])
        return self._model

    def predict(self, load: Workload, *, last: int = 0) -> float:
        """Return the model's seconds, times the median drift of the last frames against it.

        last: the number of frames, at most; 0 for the usual number. The first of an even number is left out.
        """
        num = min(last or _NUM_RECENT, _NUM_RECENT, len(self._frames))
        recent = list(self._frames)[-(num - 1 + num % 2) :] if num else []
        drift = statistics.median(taken / self.model.seconds(drawn) for drawn, taken in recent) if recent else 1.0
        return drift * self.model.seconds(load)


class LODCostEstimator:
    """Predicts what frames of a stage cost at each level of detail, from those that were drawn."""

    def __init__(self, stage: Stage) -> None:
        self.stage, self.log, self.primitive = stage, CostLog(), make_primitive(stage)
        self._seen: dict[float, Workload] = {}  # by size

    def size(self, lod: LOD) -> float:
        """Return the size of an LOD, as its primitive defines it."""
        return self.primitive.lod_size(lod.tolerance, lod.num_cells)

    def make_draw_list(self, number: int, tolerance: float, watch: Stopwatch) -> DrawList:
        """Cut at a tolerance, and sort for a frame."""
        return make_draw_list(self.stage, self.primitive.make_lod(tolerance, watch.lap), number, watch)

    def predict(self, draw_list: DrawList, *, last: int = 0) -> float:
        """Return the seconds from a finished LOD to the written frame; `last` as in CostLog."""
        load = workload_of(draw_list)
        self._seen[self.size(draw_list.lod)] = load
        return self.log.predict(load, last=last) + draw_list.order_seconds

    def record_frame(self, draw_list: DrawList, watch: Stopwatch, *, is_first: bool = False) -> None:
        """Record a frame that has just been drawn and written.

        is_first: whether it is the first of several of its LOD. Its uploads serve the others and do not count.
        """
        watch.lap("written")
        others = (*_CUT_STAGES, UPLOAD_STAGE) if is_first else _CUT_STAGES
        seconds = sum(seconds for name, seconds in watch.seconds.items() if name not in others)
        self.log.add(workload_of(draw_list), seconds)

    def size_for_seconds(self, seconds: float, *, last: int = 0) -> float:
        """Return the size at which a frame is expected to take this long, from the frames predicted so far.

        Between two sizes, seconds follow a power of the size; beyond them, that of the nearest two. `last` as in
        CostLog.
        """
        sizes = np.log(sorted(self._seen))
        costs = np.log(
            np.maximum.accumulate([self.log.predict(load, last=last) for _, load in sorted(self._seen.items())])
        )
        wanted, power = math.log(seconds), _MAX_POWER
        near = min(int(np.count_nonzero(costs < wanted)), len(sizes) - 1)
        if len(sizes) > 1:
            above = max(near, 1)
            power = (costs[above] - costs[above - 1]) / (sizes[above] - sizes[above - 1])
        power = min(max(power, _MIN_POWER), _MAX_POWER)
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
    """Draw a frame at rising sizes, until one takes `min_last_seconds`, to learn the costs of drawing.

    first_size: the first size; None for the primitive's initial one.
    on_step: called before each drawing; what it raises ends the calibration.
    """
    primitive = estimator.primitive
    size = primitive.initial_size if first_size is None else first_size
    tolerance, before, num_trials = primitive.tolerance_for_size(size), math.inf, 0
    while tolerance < before:
        on_step()
        draw_list = estimator.make_draw_list(number, tolerance, Stopwatch(clock))
        if estimator.log.is_empty:  # the first drawing compiles shaders and makes buffers
            draw_frame(estimator.stage, draw_list, rasterizer, Stopwatch(clock))
        watch = Stopwatch(clock)
        draw_frame(estimator.stage, draw_list, rasterizer, watch)
        seconds = sum(watch.seconds.values()) - watch.seconds.get(UPLOAD_STAGE, 0.0)
        estimator.log.add(workload_of(draw_list, is_written=False), seconds)
        estimator.predict(draw_list)
        num_trials += 1
        if seconds >= min_last_seconds and num_trials >= _MIN_TRIALS:
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
    """Return the finest frame predicted to fit into `seconds`, and its predicted seconds.

    It takes less where it shows every voxel, and longer where even a single cell does. Frames must have been predicted
    before.
    sizes: the smallest and the largest size allowed. last: as in CostLog.
    """
    aim = _TARGET_SHARE * seconds
    best: tuple[DrawList, float] | None = None
    tried: set[float] = set()
    for _ in range(_MAX_TRIES):
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
    """Rate a prediction against the time allowed: smaller is better, and too long is worse than too short."""
    is_too_long = predicted > _KEEP_TO_SHARE * seconds
    return is_too_long, predicted if is_too_long else abs(math.log(predicted / (_TARGET_SHARE * seconds)))


class ToleranceController(Protocol):
    """Sets, frame by frame, the tolerance at which the film is drawn."""

    def prepare_frame(self, number: int, watch: Stopwatch) -> tuple[DrawList, float | None]:
        """Return the frame to draw, and its predicted seconds from its start to that of the next one."""

    def finish_frame(self, draw_list: DrawList, watch: Stopwatch) -> None:
        """Take note that the frame has just been drawn and written."""


class ScheduleController:
    """Follows the schedule of the stage's scene, and reuses an LOD while the tolerance stays.

    estimator: predicts the frames, and learns from them.
    """

    def __init__(self, stage: Stage, estimator: LODCostEstimator | None = None) -> None:
        self._stage, self._estimator = stage, estimator
        self._lod: LOD | None = None

    def prepare_frame(self, number: int, watch: Stopwatch) -> tuple[DrawList, float | None]:
        """As in ToleranceController."""
        tolerance = tolerance_at(self._stage.scene.error, number)
        if self._lod is None or self._lod.tolerance != tolerance:
            self._lod = None  # free its memory first
            self._lod = make_primitive(self._stage).make_lod(tolerance, watch.lap)
        draw_list = make_draw_list(self._stage, self._lod, number, watch)
        return draw_list, self._estimator.predict(draw_list) if self._estimator else None

    def finish_frame(self, draw_list: DrawList, watch: Stopwatch) -> None:
        """As in ToleranceController."""
        if self._estimator:
            self._estimator.record_frame(draw_list, watch)


class BudgetController:
    """Finds, frame by frame, the finest LOD that can be drawn in time. seconds_of: the time allowed for a frame."""

    def __init__(self, estimator: LODCostEstimator, seconds_of: Callable[[int], float]) -> None:
        self._estimator, self._seconds_of = estimator, seconds_of
        self._current: _CurrentLOD | None = None

    def prepare_frame(self, number: int, watch: Stopwatch) -> tuple[DrawList, float | None]:
        """As in ToleranceController."""
        current = self._current
        if current is None:
            return self.choose(number, watch)
        seconds = self._seconds_of(number)
        draw_list = make_draw_list(self._estimator.stage, current.lod, number, watch)
        last = current.num_frames  # all of this LOD
        predicted = self._estimator.predict(draw_list, last=last)
        current.update_share(predicted / seconds)
        if current.stays(predicted, seconds):
            return draw_list, predicted
        if predicted >= _FAR_TOO_SHORT * seconds:
            last = 0
            # After a hiccup, or a change of speed, the two predictions disagree: the right direction is unknown.
            if (predicted > seconds) != (self._estimator.predict(draw_list) > seconds):
                return draw_list, predicted
        sizes = self._sizes_after(current, predicted / seconds) if seconds == current.seconds else _ANY_SIZE
        del draw_list, current  # free the memory of the old LOD first
        self._current = None
        return self.choose(number, watch, sizes=sizes, last=last)

    def choose(
        self, number: int, watch: Stopwatch, *, sizes: tuple[float, float] = _ANY_SIZE, last: int = 0
    ) -> tuple[DrawList, float]:
        """Find an LOD for a frame and those that follow. For the first frame, best called before its time begins.

        sizes, last: as in `find_finest_in_time`.
        """
        seconds = self._seconds_of(number)
        draw_list, predicted = find_finest_in_time(self._estimator, number, seconds, watch, sizes=sizes, last=last)
        wanted = max(1.0, self._estimator.size_for_seconds(_TARGET_SHARE * seconds, last=last))
        is_intermediate = not sizes[0] <= wanted <= sizes[1]
        self._current = _CurrentLOD(draw_list.lod, predicted / seconds, seconds, is_intermediate)
        return draw_list, predicted

    def finish_frame(self, draw_list: DrawList, watch: Stopwatch) -> None:
        """As in ToleranceController."""
        assert self._current is not None
        self._estimator.record_frame(draw_list, watch, is_first=self._current.num_frames == 0)
        self._current.num_frames += 1

    def _sizes_after(self, current: _CurrentLOD, share: float) -> tuple[float, float]:
        """Return the bounds of the next size, given the part of its time that the current LOD takes."""
        primitive, size = self._estimator.primitive, self._estimator.size(current.lod)
        reach = max(primitive.small_size_ratio, share**_SIZE_EXPONENT, share**-_SIZE_EXPONENT)
        reach = min(reach, primitive.size_ratio)
        return size / reach, size * reach


@dataclass
class _CurrentLOD:
    """The LOD that a film on a budget is drawn at.

    share: the part of its time that it was predicted to take. num_frames: drawn so far. is_intermediate: another one,
    too far away to reach at once, was predicted to be nearer to that time.
    """

    lod: LOD
    share: float
    seconds: float
    is_intermediate: bool
    num_frames: int = 0

    def update_share(self, share: float) -> None:
        """Take note of the part of its time that it turns out to take: perhaps it is near enough after all."""
        if self.is_intermediate and abs(share / _TARGET_SHARE - 1) <= _MAX_DRIFT:
            self.share, self.is_intermediate = share, False

    def stays(self, predicted: float, seconds: float) -> bool:
        """Return whether it is kept, now that a frame of it is predicted to take this long."""
        share = predicted / seconds
        if share < 1 and self.lod.tolerance == 0:
            return True
        least, most = _FAR_TOO_SHORT * min(1, self.share), _FAR_TOO_LONG * max(1, self.share)
        num_frames = self.num_frames if seconds == self.seconds else _MIN_FRAMES + 1
        if self.is_intermediate:
            return num_frames <= 1 and share >= _FAR_TOO_SHORT
        if share >= least and (num_frames <= 1 or (num_frames <= _MIN_FRAMES and share < most)):
            return True
        if not _KEEP_FROM_SHARE <= self.share <= _KEEP_TO_SHARE:  # no LOD was nearer, and none will be now
            return abs(share / self.share - 1) < _MAX_DRIFT
        return _KEEP_FROM_SHARE <= share <= _KEEP_TO_SHARE
