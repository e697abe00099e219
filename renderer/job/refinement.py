"""Plan the passes of a film that refines while time remains: complete films, each more exact than the one before.

The first pass has few cells and is finished soon. Its frames and some trial frames show the cost of drawing on this
machine. Each following pass takes about 8 times as long as the pass before, and the last pass has the accuracy that the
scene requests. So all passes together take little longer than the last pass alone.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.accuracy import spread_evenly
from renderer.film import over_black
from renderer.frame import (
    BudgetController,
    LODCostEstimator,
    ScheduleController,
    Stopwatch,
    ToleranceController,
    calibrate_costs,
    find_finest_in_time,
)
from renderer.job.checkpoint import FrameStore, remove_checkpoint_frames
from renderer.job.executor import DrawnFrame
from renderer.job.film_making import FilmInProgress, JobResult
from renderer.job.plan import FilmPlan
from renderer.record import DifferenceRecord, FrameRecord, PassRecord, min_max, range_text
from renderer.scene import (
    ErrorSpec,
    MetricTarget,
    OutputSpec,
    SplatBudget,
    TimeBudget,
    pluralize_range,
    tolerance_at,
    value_at,
    with_tolerances,
)
from renderer.system import deferrable_interrupts

# The time of a frame of the first pass, as a multiple of the time of the coarsest picture that shows anything. With few
# cells, most time goes to pixels, so that a first pass that takes a little longer has many more cells.
_FIRST_PASS_FACTOR = 1.3
# The time of each pass, as a multiple of the time of the pass before.
_PASS_FACTOR = 8.0
# A pass is worth drawing only if it takes at least this many times as long as the pass before.
_MIN_PASS_FACTOR = 3.0
# Trial frames that show the cost of more cells become larger until one takes this fraction of the time of a frame of
# the last pass.
_TRIAL_FRACTION = 0.1
# Trial frames that show the cost of more cells become larger until one takes this many seconds.
_MAX_TRIAL_S = 0.5
# A pass after the first is begun only if it is predicted to take at most this fraction of the time until the deadline.
_SAFE_FRACTION = 0.9
# The number of frames from which the time of the last pass is predicted.
_NUM_SAMPLED_FRAMES = 3
# The largest number of bytes of a pass's pictures that are kept, to compare them with the pictures of the next pass.
_MAX_COMPARED_BYTES = 2**26


class DeadlineReached(Exception):  # noqa: N818  no error
    """The exception by which a pass is given up because the deadline is reached. It is no error."""


@dataclass(frozen=True)
class Refinement:
    """A way to make a film in passes. Each pass is a complete film and replaces the pass before; no frames are kept.

    time_limit: the seconds from the start of the job to the deadline. The first pass is drawn in any case.
    best_effort: whether an interrupt after the first pass is no error.
    """

    time_limit: float = math.inf
    best_effort: bool = False

    def __call__(self, film: FilmInProgress) -> JobResult:
        """Draw pass after pass, until one has the accuracy that the scene requests, or the time is up."""
        refiner, output = Refiner(film, film.start + self.time_limit), film.output
        try:
            for each in refiner.plan_passes():
                refiner.make_pass(each)
            if not each.plan.is_unfinished:
                remove_checkpoint_frames(output.folder, output.spec, output.frames, of=film.fingerprint)
        except DeadlineReached:
            pass
        except KeyboardInterrupt:
            if refiner.made is not None:
                film.events.pass_finished(f"{output.spec.file} is whole, as pass {len(refiner.passes)} made it")
            if refiner.made is None or not self.best_effort:
                raise
        assert refiner.made is not None
        return refiner.made


class Pass(NamedTuple):
    """A pass to draw: a complete film. frame_seconds: the predicted mean seconds of a frame."""

    plan: FilmPlan
    frame_seconds: float


class _Work(NamedTuple):
    """An estimate of the work of a frame.

    typical_seconds: the seconds that a software renderer on two cores would take to draw it, from which the estimator
        predicts the seconds of this machine.
    order_seconds: the seconds to sort it. size: the size of its level of detail, as the primitive defines it.
    """

    typical_seconds: float
    order_seconds: float
    size: float


class Refiner:
    """A planner of passes, which plans each pass by the times of the frames before it.

    deadline: the time, by `perf_counter`, at which the last pass must be finished. passes: the records of the passes
    that are finished. made: the result of the last finished pass; None before the first is finished.
    """

    def __init__(self, film: FilmInProgress, deadline: float) -> None:
        self._film, self._deadline = film, deadline
        self._estimator, self._frames = LODCostEstimator(film.stage), film.output.frames
        self._error = film.stage.scene.error
        self._store = ComparedFrames(film.output.spec, self._frames)
        self.passes: list[PassRecord] = []
        self.made: JobResult | None = None

    def plan_passes(self) -> Iterator[Pass]:
        """Yield as many passes as there is time for. Each pass is planned when the pass before it is finished.

        Raises DeadlineReached if the time ends while a pass is planned.
        """
        primitive = self._estimator.primitive
        initial_tolerance = primitive.tolerance_for_size(primitive.initial_size)
        for _ in range(2):  # the first call also loads the kernels, and its time does not count
            initial = self._estimator.make_draw_list(self._frames[0], initial_tolerance, _stopwatch())
        first = _FIRST_PASS_FACTOR * self._estimator.predict(initial)
        if self._may_skip_first_pass(first):
            plan = self._final_plan()
            last = self._seconds(self._work(plan))
            if last < _MIN_PASS_FACTOR * first:
                yield Pass(plan, last)
                return
        yield self._pass_within(first, self._error)
        self.require_time()
        plan = self._final_plan()
        self.require_time()
        work = self._work(plan)
        self._calibrate_costs(work)
        while True:
            before, last = self.passes[-1].seconds / len(self._frames), self._seconds(work)
            wanted = _next_frame_seconds(before, last)
            affordable = _SAFE_FRACTION * (self._deadline - time.perf_counter()) / len(self._frames)
            if wanted > affordable:
                if affordable >= _MIN_PASS_FACTOR * before:
                    yield self._pass_within(affordable, plan.stage.scene.error)
                return
            if wanted == last:
                yield Pass(plan, last)
                return
            yield self._pass_within(wanted, plan.stage.scene.error)

    def require_time(self) -> None:
        """Raise DeadlineReached if the deadline is reached and a pass is finished."""
        if self.passes and time.perf_counter() > self._deadline:
            raise DeadlineReached

    def make_pass(self, each: Pass) -> None:
        """Draw and write the film of a pass, and tell the listener its summary. Raises DeadlineReached."""
        film, start = self._film, time.perf_counter()
        label = f"{film.output.spec.file.name}, pass {len(self.passes) + 1}"
        with deferrable_interrupts() as defer_interrupts:
            frames = film.write_frames(each.plan, self._store, label, defer_interrupts, self.require_time)
            self._record_pass(each, start, frames)
            # A deferred interrupt is raised at the end of the block. By then, the result of the pass is set.
            self.made = film.finish(each.plan, frames, passes=self.passes)
            film.events.pass_finished(self._summary(frames))

    def _record_pass(self, each: Pass, start: float, frames: Sequence[FrameRecord]) -> None:
        """Add the record of the pass that has just drawn these frames. start: the time at which the pass began."""
        now = time.perf_counter()
        self.passes.append(
            PassRecord(
                tolerance=min_max([frame.tolerance for frame in frames]),
                cells=min_max([frame.cells for frame in frames]),
                predicted_seconds=each.frame_seconds * len(frames),
                seconds=now - start,
                after_seconds=now - self._film.start,
                difference=self._store.finish_pass(),
            )
        )

    def _summary(self, frames: Sequence[FrameRecord]) -> str:
        """Return a line about the last finished pass, which drew these frames."""
        last, noun = self.passes[-1], self._film.stage.scene.primitive_name
        facts = [
            f"pass {len(self.passes)}: tolerance {range_text(last.tolerance)}",
            f"{pluralize_range([frame.primitives for frame in frames], noun)} a frame",
            f"{last.seconds:.1f} s (predicted: {last.predicted_seconds:.1f} s)",
        ]
        if last.difference is not None:
            psnr_db = last.difference.psnr_db
            facts.append("nothing changed" if psnr_db is None else f"{psnr_db:.1f} dB from the pass before")
        return ", ".join(facts)

    def _may_skip_first_pass(self, first: float) -> bool:
        """Return whether the last pass may have so few cells that a coarser pass before it is useless.

        first: the predicted seconds of a frame of the first pass. The cut of the last pass is not made to decide this,
        as it may take long. If the goal is an accuracy, the search for it takes long, and no pass is skipped.
        """
        goal, frames = self._error.goal, self._frames
        if isinstance(goal, MetricTarget):
            return False
        max_cells = self._estimator.max_cells(_MIN_PASS_FACTOR * first)
        if isinstance(goal, SplatBudget):
            return max(value_at(goal.value, frame) for frame in frames) <= max_cells
        if isinstance(goal, TimeBudget):
            largest = max(value_at(goal.value, frame) for frame in frames)
            if largest < _MIN_PASS_FACTOR * first:
                return True
        finest = 0.0 if goal else min(tolerance_at(self._error, frame) for frame in frames)
        return not self._estimator.primitive.has_more_cells(finest, max_cells)

    def _final_plan(self) -> FilmPlan:
        plan = self._film.plan(self._estimator, self.require_time)
        if isinstance(plan.controller, ScheduleController):
            return replace(plan, controller=ScheduleController(plan.stage, self._estimator))
        return plan

    def _work(self, plan: FilmPlan) -> list[_Work]:
        """Return the estimated work of some frames of the last pass. plan: the plan of the last pass."""
        goal = self._error.goal
        sampled_frames = spread_evenly(self._frames, _NUM_SAMPLED_FRAMES, is_loop=True)
        if isinstance(goal, TimeBudget):
            frame_by_budget = {value_at(goal.value, frame): frame for frame in sampled_frames}
            draw_lists = (
                find_finest_in_time(self._estimator, frame, seconds, _stopwatch())[0]
                for seconds, frame in frame_by_budget.items()
            )
        else:
            controller = ScheduleController(plan.stage)
            draw_lists = (controller.prepare_frame(frame, _stopwatch())[0] for frame in sampled_frames)
        return [
            _Work(draw_list.typical_seconds, draw_list.order_seconds, self._estimator.size(draw_list.lod))
            for draw_list in draw_lists
        ]

    def _seconds(self, work: Sequence[_Work]) -> float:
        """Return the predicted mean seconds of a frame of the last pass. work: the work of some of its frames."""
        return statistics.fmean(self._estimator.seconds(each.typical_seconds, each.order_seconds) for each in work)

    def _calibrate_costs(self, work: Sequence[_Work]) -> None:
        """Measure the cost of more cells, if the film has several frames, and its last pass many more cells."""
        growth, first = self._estimator.primitive.size_ratio, self.passes[-1]
        first_size = growth * self._estimator.primitive.lod_size(first.tolerance[0], int(first.cells[1]))
        if len(self._frames) == 1 or max(each.size for each in work) < growth * first_size:
            return
        calibrate_costs(
            self._estimator,
            self._frames[0],
            min(_TRIAL_FRACTION * self._seconds(work), _MAX_TRIAL_S),
            self._film.executor.rasterizer,
            clock=time.perf_counter,
            first_size=first_size,
            on_step=self.require_time,
        )

    def _pass_within(self, seconds: float, finest: ErrorSpec) -> Pass:
        """Return a pass whose frames are predicted to take these seconds each.

        finest: the tolerances or the goal of the last pass; no frame is drawn at a finer tolerance.
        """
        goal, stage = self._error.goal, self._estimator.stage
        if isinstance(goal, TimeBudget):
            budgets = {frame: min(seconds, value_at(goal.value, frame)) for frame in self._frames}
            controller: ToleranceController = BudgetController(self._estimator, budgets.__getitem__)
            predicted = statistics.fmean(budgets.values())
        else:
            draw_list, predicted = find_finest_in_time(self._estimator, self._frames[0], seconds, _stopwatch())
            coarsest = draw_list.lod.tolerance
            tolerances = dict.fromkeys(self._frames, coarsest)
            if finest.goal is None:
                tolerances = {frame: max(coarsest, tolerance_at(finest, frame)) for frame in self._frames}
            stage = replace(stage, scene=with_tolerances(stage.scene, tolerances))
            controller = ScheduleController(stage, self._estimator)
        return Pass(FilmPlan(stage, controller, is_unfinished=True, is_timing_dependent=True), predicted)


def _next_frame_seconds(before: float, last: float) -> float:
    """Return the seconds of a frame of the next pass.

    before: the seconds of a frame of the pass that is finished. last: the seconds of a frame of the last pass.
    The result is `last`, divided by _PASS_FACTOR as often as it stays at least _MIN_PASS_FACTOR times `before`.
    """
    wanted = last
    while wanted / _PASS_FACTOR >= _MIN_PASS_FACTOR * before:
        wanted /= _PASS_FACTOR
    return wanted


def _stopwatch() -> Stopwatch:
    return Stopwatch(time.perf_counter)


class ComparedFrames(FrameStore):
    """A store that keeps no frames. It compares some frames, spread over the film, with those of the pass before."""

    def __init__(self, output: OutputSpec, frames: Sequence[int]) -> None:
        super().__init__(output, {}, lambda _number, _kind: output.file)
        most = max(1, _MAX_COMPARED_BYTES // 4 // math.prod(output.kind.shape))
        self._compared_frames = {*spread_evenly(frames, most, is_loop=True)}
        self._before: dict[int, npt.NDArray[np.float32]] = {}
        self._squares: list[float] = []

    def save(self, frame: DrawnFrame) -> FrameRecord:
        """Compare a drawn frame with the same frame of the pass before, and return its record."""
        number, image = frame.record.frame, over_black(frame.pictures[0].pixels).astype(np.float32)
        if number in self._before:
            change = image - self._before[number]
            self._squares.append(float(np.mean(change * change, dtype=np.float64)))
        if number in self._compared_frames:
            self._before[number] = image
        return super().save(frame)

    def finish_pass(self) -> DifferenceRecord | None:
        """Return the root mean square difference of frames (channels in [0, 1]) from the pass before.

        Return None for the first pass.
        """
        squares, self._squares = self._squares, []
        if not squares:
            return None
        rmse = math.sqrt(math.fsum(squares) / len(squares))
        return DifferenceRecord(rmse, len(squares), -20 * math.log10(rmse) if rmse > 0 else None)
