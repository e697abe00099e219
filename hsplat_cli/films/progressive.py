"""A film that refines while time remains: whole films, one after the other, each more exact than the one before.

The first pass has few cells and is there soon. Its frames and some trial drawings tell what drawing costs here; the
following passes take 8 times as long each, and the last is what the scene asks for, so that all of them together take
little longer than the last one alone.
"""

from __future__ import annotations

import contextlib
import math
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import click

from hsplat_cli.executors import FrameResult, LocalExecutor, open_recovering_rasterizer
from hsplat_cli.films.background import run_overlapped, run_sequentially
from hsplat_cli.films.fingerprint import JobFingerprint
from hsplat_cli.films.finished_film import FinishedFilm, record, tell
from hsplat_cli.films.goals import make_plan
from hsplat_cli.films.pass_difference import Difference, Differences
from hsplat_cli.films.preparation import prepare_film
from hsplat_cli.films.sidecar_record import limits, span, with_seconds
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import Progress, counted, deferrable_interrupts, pluralize_range, progress
from renderer.draw import RecoveringRasterizer
from renderer.errors import RenderError
from renderer.film import (
    FilmWriter,
    Record,
    locked_output,
    open_film,
    remove_checkpoint_frames,
    require_encoder,
    sidecar_path,
)
from renderer.frame import (
    BudgetController,
    LODCostEstimator,
    Rasterizer,
    ScheduleController,
    Stopwatch,
    Workload,
    calibrate_costs,
    find_finest_in_time,
    workload_of,
)
from renderer.scene import AccuracyGoal, SplatBudget, TimeBudget, scheduled_value, tolerance_at, with_tolerances
from renderer.study import FilmPlan

# Of the first frame that shows what it is, the first pass may take so many times as long. It has few cells, whose
# pixels, not their number, are what it costs, so that there are far more cells in the first pass.
_FIRST_PASS_FACTOR = 1.3
# Each pass takes so many times as long as the one before; the second one, to be worth the while, at least so many.
_PASS_FACTOR, _MIN_PASS_FACTOR = 8.0, 3.0
# Trial drawings, which tell what more cells cost, go up to this part of a frame of the last pass, and up to so long.
_TRIAL_FRACTION, _MAX_TRIAL_S = 0.1, 0.5
# Of the time that remains a pass may be predicted to take this part.
_SAFE_FRACTION = 0.9
# Frames from which the time of a pass is predicted.
_NUM_SAMPLED_FRAMES = 3


class _DeadlineReached(Exception):  # noqa: N818  no error
    """The deadline has come; the pass is given up."""


@dataclass(frozen=True)
class _Pass:
    """A film to be made. frame_seconds: what a frame is predicted to take."""

    plan: FilmPlan
    frame_seconds: float


def render_progressively(
    job: Job, *, time_limit: float | None, best_effort: bool, force: bool, quiet: bool
) -> RenderError | None:
    """Film after film, until one is what the scene asks for or time is up; what was asked for and not had.

    time_limit: seconds; the first pass is made all the same. When a later one is interrupted, the film of the pass
    before it stays; KeyboardInterrupt then goes on, unless `best_effort` takes that film for good enough. Nothing is
    made where the last film is there already, unless with `force`.
    """
    start = time.perf_counter()
    place = locked_output(job.scene.output, job.frames, sidecar_path(job.scene, job.frames))
    with place as folder, open_recovering_rasterizer(needs_opengl=job.scene.needs_opengl) as rasterizer:
        require_encoder(job.scene.output)
        begun = prepare_film(job, folder, rasterizer.renderer_name, force=force, quiet=quiet)
        if begun is None:
            return None
        job = begun.job
        maker = _PassRenderer(job, begun.cause, folder, rasterizer, start, time_limit, quiet=quiet)
        planner = _PassPlanner(job, LODCostEstimator(begun.stage), rasterizer, quiet=quiet)
        try:
            for each in planner.passes(maker):
                maker.make(each)
        except _DeadlineReached:
            pass
        except KeyboardInterrupt:
            maker.report_interrupted()
            if not (maker.done and best_effort):
                raise
        assert maker.done is not None
        if not maker.done.plan.is_unfinished:
            remove_checkpoint_frames(folder, job.scene.output, job.frames, begun.cause.of)
    tell(maker.done, quiet=quiet)
    return maker.done.shortfall


class _PassRenderer:
    """Makes one film after the other under the same name, each complete before it takes the place of the one before."""

    def __init__(
        self,
        job: Job,
        cause: JobFingerprint,
        folder: Path,
        rasterizer: RecoveringRasterizer,
        start: float,
        time_limit: float | None,
        *,
        quiet: bool,
    ) -> None:
        self._job, self._cause, self._folder = job, cause, folder
        self._rasterizer, self._start, self._quiet = rasterizer, start, quiet
        self._deadline = math.inf if time_limit is None else start + time_limit
        output = job.scene.output
        self._differences = Differences(job.frames, math.prod(output.size) * (4 if output.background is None else 3))
        self._passes: list[dict[str, Any]] = []
        self.done: FinishedFilm | None = None

    def remaining_seconds(self) -> float:
        """Seconds."""
        return self._deadline - time.perf_counter()

    @property
    def frame_seconds(self) -> float:
        """What a frame of the last pass took, in the mean."""
        return float(self._passes[-1]["seconds"]) / len(self._job.frames)

    @property
    def finest(self) -> tuple[float, int]:
        """Of the last pass: the smallest tolerance, and the largest number of cells."""
        return float(self._passes[-1]["tolerance"][0]), int(self._passes[-1]["cells"][1])

    @property
    def tolerance(self) -> float:
        """Of the last pass, at most."""
        return float(self._passes[-1]["tolerance"][1])

    def make(self, each: _Pass) -> None:
        """One pass. Raises _DeadlineReached where there has been one before."""
        with deferrable_interrupts() as defer_interrupts:
            self._make(each, defer_interrupts)

    def _make(self, each: _Pass, finishing: Callable[[], None]) -> None:
        job, number, start = self._job, len(self._passes) + 1, time.perf_counter()
        label = f"{job.scene.output.file.name}, pass {number}"
        with (
            open_film(job.scene.output, job.frames, within=self._folder, finishing=finishing) as film,
            progress(len(job.frames), label=label, quiet=self._quiet) as bar,
        ):
            tasks = (partial(self._write, drawn, film) for drawn in self._executor(each.plan).draw(job.frames))
            with contextlib.closing(
                run_sequentially(tasks) if each.plan.is_timing_dependent else run_overlapped(tasks)
            ) as written:
                frames = [self._count(record, bar) for record in written]
        now = time.perf_counter()
        difference = self._differences.finish_pass()
        made = {
            "tolerance": limits(frame["tolerance"] for frame in frames),
            "cells": limits(frame["cells"] for frame in frames),
            "predicted_seconds": each.frame_seconds * len(frames),
            "seconds": now - start,
            "after_seconds": now - self._start,
            "difference": difference.record() if difference else None,
        }
        self._passes.append(made)
        notes = [*film.notes, *self._rasterizer.notes]
        self.done = FinishedFilm(job, each.plan, frames, notes, [self._rasterizer.renderer_name], now - self._start)
        record(self.done, self._folder, self._cause, passes=self._passes)
        if not self._quiet:
            click.echo(f"pass {number}: {', '.join(_facts(made, frames, job.scene.splat.primitive_name, difference))}")

    def accept(self, plan: FilmPlan) -> None:
        """The last film is what was asked for, or better, as `plan` has found out."""
        assert self.done is not None
        met = replace(self.done.plan, is_unfinished=False, found=plan.found, shortfall=plan.shortfall)
        self.done = replace(self.done, plan=met)
        record(self.done, self._folder, self._cause, passes=self._passes)

    def report_interrupted(self) -> None:
        """Say what there is now, if there is something."""
        if self.done and not self._quiet:
            click.echo(f"{self._job.scene.output.file} is whole, as pass {len(self._passes)} made it")

    def require_time(self) -> None:
        """Raise _DeadlineReached where it is, and there is a film."""
        if self.done and self.remaining_seconds() < 0:
            raise _DeadlineReached

    def _executor(self, plan: FilmPlan) -> LocalExecutor:
        return LocalExecutor(plan.stage, self._rasterizer, plan.controller)

    def _write(self, drawn: FrameResult, film: FilmWriter) -> Record:
        before = time.perf_counter()
        film.write(drawn.number, drawn.picture.pixels)
        record = with_seconds(drawn.record, encode=time.perf_counter() - before)
        self._differences.see(drawn.number, drawn.picture.pixels)
        return record

    def _count(self, record: Record, bar: Progress) -> Record:
        if record["frame"] != self._job.frames[-1]:
            self.require_time()
        bar.advance(counted(record["splats"], self._job.scene.splat.primitive_name))
        return record


def _facts(made: Record, frames: Sequence[Record], noun: str, difference: Difference | None) -> Iterator[str]:
    yield f"tolerance {span(made['tolerance'])}"
    yield f"{pluralize_range([frame['splats'] for frame in frames], noun)} a frame"
    yield f"{made['seconds']:.1f} s (predicted: {made['predicted_seconds']:.1f} s)"
    if difference:
        yield str(difference)


class _Work(NamedTuple):
    """What there is to do in a frame. order_seconds: of its order. size: as in Family."""

    load: Workload
    order_seconds: float
    size: float


class _PassPlanner:
    """Decides what the next pass is, by what frames took in the passes before."""

    def __init__(self, job: Job, estimator: LODCostEstimator, rasterizer: Rasterizer, *, quiet: bool) -> None:
        self._estimator, self._frames, self._error = estimator, job.frames, job.scene.error
        self._rasterizer, self._quiet = rasterizer, quiet

    def passes(self, maker: _PassRenderer) -> Iterator[_Pass]:
        """The passes, each decided when the one before it has been made; as many as there is time for."""
        few = self._estimator.make_draw_list(
            self._frames[0],
            self._estimator.primitive.tolerance_for_size(self._estimator.primitive.initial_size),
            _stopwatch(),
        )
        first = _FIRST_PASS_FACTOR * self._estimator.predict(few)
        if self._may_skip_first_pass(first):
            plan = self._final_plan(maker)
            last = self._seconds(self._work(plan))
            if last < _MIN_PASS_FACTOR * first:
                yield _Pass(plan, last)
                return
        yield self._pass_within(first)
        maker.require_time()
        plan = self._final_plan(maker)
        if plan.found is not None and (plan.found.tolerance or 0.0) >= maker.tolerance:
            maker.accept(plan)
            return
        maker.require_time()
        work = self._work(plan)
        self._calibrate_costs(maker, work)
        while True:
            before, last = maker.frame_seconds, self._seconds(work)
            wanted, affordable = (
                _next_frame_seconds(before, last),
                _SAFE_FRACTION * maker.remaining_seconds() / len(self._frames),
            )
            if wanted > affordable:
                if affordable >= _MIN_PASS_FACTOR * before:
                    yield self._pass_within(affordable, plan)
                return
            if wanted == last:
                yield _Pass(plan, last)
                return
            yield self._pass_within(wanted, plan)

    def _may_skip_first_pass(self, first: float) -> bool:
        """Whether the last pass may have so few cells that the first, of so many seconds a frame, is not worth it.

        Told without the last pass's cut, which may take long. An accuracy takes long to look for in any case.
        """
        goal, frames = self._error.goal, self._frames
        if isinstance(goal, AccuracyGoal):
            return False
        per_splat = self._estimator.log.model.per_splat
        max_cells = _MIN_PASS_FACTOR * first / per_splat if per_splat > 0 else math.inf
        if isinstance(goal, SplatBudget):
            return max(scheduled_value(goal.by_frame, frame) for frame in frames) <= max_cells
        if (
            isinstance(goal, TimeBudget)
            and max(scheduled_value(goal.by_frame, frame) for frame in frames) < _MIN_PASS_FACTOR * first
        ):
            return True
        finest = 0.0 if goal else min(tolerance_at(self._error, frame) for frame in frames)
        return not self._estimator.primitive.has_more_cells(finest, max_cells)

    def _final_plan(self, maker: _PassRenderer) -> FilmPlan:
        frames, quiet = self._frames, self._quiet
        plan = make_plan(self._estimator, frames, self._rasterizer, quiet=quiet, on_step=maker.require_time)
        return plan if plan.controller else replace(plan, controller=ScheduleController(plan.stage, self._estimator))

    def _work(self, plan: FilmPlan) -> list[_Work]:
        """What there is to do in some frames of the last pass."""
        goal, num = self._error.goal, min(_NUM_SAMPLED_FRAMES, len(self._frames))
        looked_at = [self._frames[i * len(self._frames) // num] for i in range(num)]
        if isinstance(goal, TimeBudget):
            each = {scheduled_value(goal.by_frame, frame): frame for frame in looked_at}  # one of each budget
            draw_lists = (
                find_finest_in_time(self._estimator, frame, seconds, _stopwatch())[0] for seconds, frame in each.items()
            )
        else:
            controller = ScheduleController(plan.stage)
            draw_lists = (controller.prepare_frame(frame, _stopwatch())[0] for frame in looked_at)
        return [
            _Work(workload_of(draw_list), draw_list.order_seconds, self._estimator.size(draw_list.lod))
            for draw_list in draw_lists
        ]

    def _seconds(self, work: Sequence[_Work]) -> float:
        """What a frame of the last pass is predicted to take, in the mean."""
        return statistics.fmean(self._estimator.log.predict(each.load) + each.order_seconds for each in work)

    def _calibrate_costs(self, maker: _PassRenderer, work: Sequence[_Work]) -> None:
        """Learn what more cells cost than the first pass had, where the last one has many more and not only a frame."""
        growth = self._estimator.primitive.size_ratio
        first_size = growth * self._estimator.primitive.lod_size(*maker.finest)
        if len(self._frames) == 1 or max(each.size for each in work) < growth * first_size:
            return
        calibrate_costs(
            self._estimator,
            self._frames[0],
            min(_TRIAL_FRACTION * self._seconds(work), _MAX_TRIAL_S),
            self._rasterizer,
            clock=time.perf_counter,
            first_size=first_size,
            on_step=maker.require_time,
        )

    def _pass_within(self, seconds: float, plan: FilmPlan | None = None) -> _Pass:
        """A pass whose frames take so long, none of them finer than in the last one, as far as that is known."""
        goal, stage = self._error.goal, self._estimator.stage
        if isinstance(goal, TimeBudget):
            budgets = {frame: min(seconds, scheduled_value(goal.by_frame, frame)) for frame in self._frames}
            pacer = BudgetController(self._estimator, budgets.__getitem__)
            return _Pass(
                FilmPlan(stage, pacer, is_unfinished=True, is_timing_dependent=True), statistics.fmean(budgets.values())
            )
        draw_list, predicted = find_finest_in_time(self._estimator, self._frames[0], seconds, _stopwatch())
        coarsest, error = draw_list.lod.tolerance, plan.stage.scene.error if plan else self._error
        tolerances = dict.fromkeys(self._frames, coarsest)
        if error.goal is None:
            tolerances = {frame: max(coarsest, tolerance_at(error, frame)) for frame in self._frames}
        stage = replace(stage, scene=with_tolerances(stage.scene, tolerances))
        controller = ScheduleController(stage, self._estimator)
        return _Pass(FilmPlan(stage, controller, is_unfinished=True, is_timing_dependent=True), predicted)


def _next_frame_seconds(before: float, last: float) -> float:
    """Seconds a frame of the pass after one: `last`, or an eighth of it, or of that, as long as it is worth it."""
    wanted = last
    while wanted / _PASS_FACTOR >= _MIN_PASS_FACTOR * before:
        wanted /= _PASS_FACTOR
    return wanted


def _stopwatch() -> Stopwatch:
    return Stopwatch(time.perf_counter)
