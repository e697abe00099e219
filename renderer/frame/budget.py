"""Choose the tolerance of each frame: by the scene's schedule, or by a budget of time.

The time to draw a frame is predicted from its typical seconds: the time that a software renderer on two cores takes,
estimated from the cells and pixels of the frame. Trial frames of rising size give the ratio between the seconds of this
machine and typical seconds. The last frames of the film correct it.

With a budget of time, the finest level of detail (LOD) is chosen that is predicted to be drawn in time. It stays while
its frames keep to their time, because a film whose cut changed from frame to frame would flicker.
"""

from __future__ import annotations

import math
import statistics
from collections import deque
from collections.abc import Callable

import numpy as np

from renderer.draw import Rasterizer
from renderer.frame.frame import UPLOAD_STEP, DrawList, draw_frame, make_draw_list
from renderer.frame.primitives import LOD, TYPICAL_CELL_SECONDS, make_primitive
from renderer.frame.stage import Clock, FilmStage, Stage, Stopwatch
from renderer.scene import tolerance_at

# The seconds that writing a frame is assumed to take until the first frame is written.
_TYPICAL_WRITING = 2e-3
# The number of the last frames of a film from which the present speed of the machine is found, as a median.
_NUM_RECENT = 9
# The smallest number of trial drawings, each at another LOD. A single LOD would not show how seconds grow with its
# size.
_MIN_TRIALS = 3

# The share of its budget of seconds that a frame is meant to take.
_TARGET_SHARE = 0.95
# A frame keeps the LOD of the frame before if it is predicted to take nearly the expected share of its budget of
# seconds: the natural logarithms of the predicted and the expected share differ by at most this.
_BAND = 0.13
# An LOD stays for at least this number of frames, however long they take, while the budget of seconds is the same. The
# first LOD of a film stays for one: it was chosen before any frame was written and probed, which may take as long as
# drawing.
_MIN_FRAMES = 5
# The search for an LOD ends when the predicted seconds of a frame deviate from the wanted seconds by at most this
# share of the wanted seconds.
_TARGET_DEVIATION = 0.04
# The largest number of LODs that the search for the finest LOD in time makes.
_MAX_TRIES = 5
# The exponent that bounds a change of an LOD's size: if a frame takes f times its budget of seconds, or an f-th part of
# it, the size of the next LOD differs by a factor of at most f^_SIZE_EXPONENT.
_SIZE_EXPONENT = 3.0
# The seconds of a frame are taken to grow with a power of its LOD's size. The exponent is at least this: the time for
# a few large cells depends more on their pixels than on their number.
_MIN_POWER = 0.1
# The seconds of a frame are taken to grow with a power of its LOD's size. The exponent is at most this: the time for
# many small cells is in proportion to their number.
_MAX_POWER = 1.0
# The smallest and the largest size of the LODs that a search may choose, if all sizes are allowed.
_ANY_SIZE = 0.0, math.inf

# The names of the timed steps of a frame that do not count as drawing.
_OTHER_STEPS = ("cut", "primitives", "edges", "order", "written")
# A drawing counts as taking at least this many seconds, even if the clock stood still.
_MIN_SECONDS = 1e-9


class LODCostEstimator:
    """An estimator of the seconds that frames of a stage take at each level of detail, from frames that were drawn.

    Drawing a frame takes `fixed + rate * typical seconds`, which is fitted to the trials. It is multiplied by the
    median, over the last frames of the film, of the ratio between true and predicted seconds. Rates of their own for
    splats, pixels and frames kept fewer frames of splats in time, 44 % in place of 60 %, and as many of bricks.
    """

    def __init__(self, stage: FilmStage) -> None:
        self.stage, self.primitive = stage, make_primitive(stage.at(0))
        self._fixed, self._rate = 0.0, 1.0
        self._trials: list[tuple[float, float]] = []  # typical and measured seconds to draw each trial
        # typical and measured seconds to draw each of the last frames
        self._frames: deque[tuple[float, float]] = deque(maxlen=_NUM_RECENT)
        self._writing: deque[float] = deque(maxlen=_NUM_RECENT)  # seconds to write, and to probe, the last frames
        self._seen: dict[float, tuple[float, float]] = {}  # typical seconds to draw, and to sort, by size

    @property
    def has_written(self) -> bool:
        """Return whether a frame was written, so that the time to write one is known."""
        return bool(self._writing)

    def size(self, lod: LOD) -> float:
        """Return the size of an LOD, as its kind of primitive (splats or bricks) defines it."""
        return self.primitive.lod_size(lod.tolerance, lod.num_cells)

    def make_draw_list(self, number: int, tolerance: float, watch: Stopwatch) -> DrawList:
        """Return the primitives of a frame at a tolerance, sorted for drawing."""
        stage = self.stage.at(number)
        return make_draw_list(stage, make_primitive(stage).make_lod(tolerance, watch.lap), number, watch)

    def predict(self, draw_list: DrawList) -> float:
        """Return the predicted seconds to sort, draw and write a frame whose LOD is made."""
        seen = self._seen[self.size(draw_list.lod)] = draw_list.typical_seconds, draw_list.order_seconds
        return self.seconds(*seen)

    def seconds(self, typical_seconds: float, order_seconds: float) -> float:
        """Return the predicted seconds to sort, draw and write a frame.

        typical_seconds: the typical seconds to draw it. order_seconds: the seconds to sort it.
        """
        drifts = [taken / self._draw_seconds(typical) for typical, taken in self._frames]
        drift = statistics.median(drifts or [1.0])
        writing = statistics.median(self._writing or [_TYPICAL_WRITING])
        return order_seconds + drift * self._draw_seconds(typical_seconds) + writing

    def max_cells(self, seconds: float) -> float:
        """Return an upper bound of the number of cells that can be drawn in a time, as if pixels cost no time."""
        return seconds / (self._rate * TYPICAL_CELL_SECONDS)

    def record_trial(self, draw_list: DrawList, seconds: float) -> None:
        """Record the time to draw a trial frame, which does not belong to the film."""
        self._trials.append((draw_list.typical_seconds, max(seconds, _MIN_SECONDS)))
        typical, taken = np.array(self._trials).T
        self._fixed, self._rate = 0.0, float(np.median(taken / typical))
        if np.ptp(typical) > 0:
            rate, fixed = np.polyfit(typical, taken, 1, w=1 / taken).tolist()
            if rate > 0 and fixed > 0:
                self._fixed, self._rate = fixed, rate

    def record_frame(self, draw_list: DrawList, watch: Stopwatch, *, is_first: bool = False) -> None:
        """Record a frame that has just been drawn and written.

        is_first: whether it is the first frame of its LOD. Its seconds of uploading splats or bricks to the device do
            not count, as later frames of the LOD need no upload.
        """
        self._writing.append(watch.lap("written"))
        others = (*_OTHER_STEPS, UPLOAD_STEP) if is_first else _OTHER_STEPS
        seconds = sum(seconds for name, seconds in watch.seconds.items() if name not in others)
        self._frames.append((draw_list.typical_seconds, max(seconds, _MIN_SECONDS)))

    def _draw_seconds(self, typical_seconds: float) -> float:
        return self._fixed + self._rate * typical_seconds

    def size_for_seconds(self, seconds: float) -> float:
        """Return the size at which a frame is expected to take `seconds`, from the frames predicted so far.

        Between two sizes with predictions, seconds follow a power of the size. Beyond all of them, the power between
        the nearest two holds.
        """
        seen = sorted(self._seen.items())
        sizes = np.log([size for size, _ in seen])
        costs = np.log(np.maximum.accumulate([self.seconds(*each) for _, each in seen]))
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

    first_size: the first size, if frames were drawn before; None for the primitive's initial size.
    on_step: a function that is called before each drawing; an error that it raises ends the calibration.
    """
    primitive = estimator.primitive
    size = primitive.initial_size if first_size is None else first_size
    tolerance, before, num_trials = primitive.tolerance_for_size(size), math.inf, 0
    while tolerance < before:
        on_step()
        draw_list = estimator.make_draw_list(number, tolerance, Stopwatch(clock))
        if first_size is None and num_trials == 0:  # the first drawing compiles shaders and makes buffers
            draw_frame(draw_list, rasterizer, Stopwatch(clock))
        watch = Stopwatch(clock)
        draw_frame(draw_list, rasterizer, watch)
        seconds = sum(watch.seconds.values()) - watch.seconds.get(UPLOAD_STEP, 0.0)
        estimator.record_trial(draw_list, seconds)
        estimator.predict(draw_list)
        num_trials += 1
        if seconds >= min_last_seconds and num_trials >= _MIN_TRIALS:
            return
        size *= primitive.size_ratio
        tolerance, before = primitive.tolerance_for_size(size), tolerance


def find_finest_in_time(
    estimator: LODCostEstimator, number: int, seconds: float, watch: Stopwatch, sizes: tuple[float, float] = _ANY_SIZE
) -> tuple[DrawList, float]:
    """Return the finest frame predicted to fit into `seconds`, and its predicted seconds.

    A frame that shows every voxel may take less time, and a frame of a single cell may take more. The estimator must
    have predicted frames before. sizes: the smallest and the largest size allowed.
    """
    aim = _TARGET_SHARE * seconds
    best: tuple[DrawList, float] | None = None
    tried: set[float] = set()
    for _ in range(_MAX_TRIES):
        wanted = min(max(estimator.size_for_seconds(aim), sizes[0]), sizes[1])
        tolerance = estimator.primitive.tolerance_for_size(wanted)
        if tolerance in tried:
            break
        tried.add(tolerance)
        draw_list = estimator.make_draw_list(number, tolerance, watch)
        predicted = estimator.predict(draw_list)
        if best is None or _badness(predicted / aim) < _badness(best[1] / aim):
            best = draw_list, predicted
        if abs(predicted - aim) <= _TARGET_DEVIATION * aim:
            break
    assert best is not None
    return best


def _badness(share: float) -> tuple[bool, float]:
    """Return a key that is the larger, the worse the predicted seconds of a frame fit the wanted seconds.

    share: the predicted seconds, divided by the wanted seconds. A share whose logarithm is above _BAND is worse than
    any smaller share.
    """
    off = math.log(share)
    return off > _BAND, abs(off)


class ScheduleController:
    """A controller that follows the schedule of the stage's scene, and reuses an LOD while the tolerance stays.

    estimator: the estimator that predicts the frames and learns from them; None for no predictions.
    """

    def __init__(self, stage: FilmStage, estimator: LODCostEstimator | None = None) -> None:
        self._stage, self._estimator = stage, estimator
        self._lod: LOD | None = None
        self._made_for: Stage | None = None

    def prepare_frame(self, number: int, watch: Stopwatch) -> tuple[DrawList, float | None]:
        """Return the frame to draw, and the predicted seconds from its start to the start of the next frame."""
        stage, tolerance = self._stage.at(number), tolerance_at(self._stage.scene.error, number)
        is_same = self._made_for is not None and stage.has_lods_of(self._made_for)
        if self._lod is None or self._lod.tolerance != tolerance or not is_same:
            self._lod = None  # two LODs at a time would take twice the memory
            self._lod, self._made_for = make_primitive(stage).make_lod(tolerance, watch.lap), stage
        draw_list = make_draw_list(stage, self._lod, number, watch)
        return draw_list, self._estimator.predict(draw_list) if self._estimator else None

    def finish_frame(self, draw_list: DrawList, watch: Stopwatch) -> None:
        """Learn from the frame that has just been drawn and written, if there is an estimator."""
        if self._estimator:
            self._estimator.record_frame(draw_list, watch)


class BudgetController:
    """A controller that finds, frame by frame, the finest LOD that can be drawn in time.

    seconds_of: a function that returns the time allowed for a frame.
    """

    def __init__(self, estimator: LODCostEstimator, seconds_of: Callable[[int], float]) -> None:
        self._estimator, self._seconds_of = estimator, seconds_of
        self._lod: LOD | None = None
        self._made_for: Stage | None = None
        self._seconds, self._expected_share, self._num_frames = 0.0, _TARGET_SHARE, 0
        self._min_frames = 1

    def prepare_frame(self, number: int, watch: Stopwatch) -> tuple[DrawList, float | None]:
        """Return the frame to draw, and the predicted seconds from its start to the start of the next frame."""
        if self._lod is None:
            return self.choose(number, watch)
        seconds = self._seconds_of(number)
        stage = self._estimator.stage.at(number)
        if self._made_for is None or not stage.has_lods_of(self._made_for):
            self._lod, self._made_for = make_primitive(stage).make_lod(self._lod.tolerance, watch.lap), stage
        draw_list = make_draw_list(stage, self._lod, number, watch)
        predicted = self._estimator.predict(draw_list)
        share = predicted / seconds
        is_kept = abs(math.log(share / self._expected_share)) <= _BAND or (share < 1 and self._lod.tolerance == 0)
        if is_kept or (self._num_frames < self._min_frames and seconds == self._seconds):
            return draw_list, predicted
        if seconds != self._seconds:
            return self.choose(number, watch)
        size, reach = self._estimator.size(self._lod), max(share, 1 / share) ** _SIZE_EXPONENT
        reach = min(reach, self._estimator.primitive.size_ratio)
        return self.choose(number, watch, (size / reach, size * reach))

    def choose(self, number: int, watch: Stopwatch, sizes: tuple[float, float] = _ANY_SIZE) -> tuple[DrawList, float]:
        """Find an LOD for a frame and the frames after it. For the first frame, call it before the frame's time begins.

        sizes: the smallest and the largest size allowed.
        """
        seconds, self._lod = self._seconds_of(number), None  # two LODs at a time would take twice the memory
        draw_list, predicted = find_finest_in_time(self._estimator, number, seconds, watch, sizes)
        wanted = max(1.0, self._estimator.size_for_seconds(_TARGET_SHARE * seconds))
        # If `sizes` excluded the best LOD, _TARGET_SHARE is expected, so that the next frame comes closer to that LOD.
        self._expected_share = predicted / seconds if sizes[0] <= wanted <= sizes[1] else _TARGET_SHARE
        self._lod, self._seconds, self._num_frames = draw_list.lod, seconds, 0
        self._min_frames = _MIN_FRAMES if self._estimator.has_written else 1
        self._made_for = draw_list.stage
        return draw_list, predicted

    def finish_frame(self, draw_list: DrawList, watch: Stopwatch) -> None:
        """Learn from the frame that has just been drawn and written."""
        self._estimator.record_frame(draw_list, watch, is_first=self._num_frames == 0)
        self._num_frames += 1


# A controller sets, frame by frame, the tolerance at which the film is drawn.
ToleranceController = ScheduleController | BudgetController
