"""Render a job to a film: one loop over passes and frames, with checkpoint, resume and sidecar.

A film has one pass, whose finished frames are kept. A progressive film has several: each is a complete film that
replaces the one before, and no frames are kept.
"""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from hsplat_cli.executors import Executor, ExecutorSpec, FrameExecutor, FrameResult, open_executor
from hsplat_cli.films.background import run_overlapped
from hsplat_cli.films.film import DrawnPass, FilmResult, finish_film
from hsplat_cli.films.goals import make_plan
from hsplat_cli.films.progressive import DeadlineReached, Refinement, Refiner
from hsplat_cli.films.resume import PreparedFilm, prepare_film, report_resumable, resume_checkpoint
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import Reporter, counted, deferrable_interrupts
from renderer.film import (
    FrameCheckpoint,
    Record,
    bytes_digest,
    film_notes,
    has_frame_files,
    locked_output,
    open_film,
    remove_checkpoint_frames,
    require_encoder,
    sidecar_path,
)
from renderer.frame import LODCostEstimator


def render_film(
    job: Job,
    executor_spec: ExecutorSpec,
    reporter: Reporter,
    *,
    refinement: Refinement | None = None,
    work_folder: Path | None = None,
    on_start: Callable[[], None] | None = None,
    force: bool = False,
    is_auxiliary: bool = False,
) -> FilmResult:
    """Render the film of a job, or return the film that is up to date.

    Frames that an earlier job finished are kept; with `force` they are drawn again.

    refinement: draw a coarse film first, and refine it, in one process.
    work_folder: the folder for unfinished work, where the caller has locked the output.
    on_start: called before anything is drawn; not for a film that is up to date.
    is_auxiliary: the film is a means to another end, in a new folder: only progress is shown.

    Raises HsplatError; KeyboardInterrupt, unless a pass was finished before it and the refinement is a best effort.
    """
    start, output = time.perf_counter(), job.scene.output
    with contextlib.ExitStack() as stack:
        # What can fail early is tried before a voxel is read: the outputs, the encoder, OpenGL or the cluster.
        sidecar = sidecar_path(job.scene, job.frames)
        folder = work_folder or stack.enter_context(locked_output(output, job.frames, sidecar))
        require_encoder(output)
        spec = executor_spec if refinement is None else ExecutorSpec(workers=1)
        executor = stack.enter_context(open_executor(spec, job.scene, reporter))
        prepared = prepare_film(job, folder, executor.renderer_name, reporter, force=force)
        if prepared.stage is None:
            assert prepared.recorded is not None
            return FilmResult(output.file, sidecar, prepared.recorded.data)
        if on_start is not None:
            on_start()
        renderer = _FilmRenderer(executor, folder, start, reporter, is_auxiliary=is_auxiliary)
        film = renderer.refine(prepared, refinement) if refinement else renderer.render(prepared, force=force)
    if not is_auxiliary:
        film.report(reporter)
    return film


class _FilmRenderer:
    """Draws the passes of a film. start: when the job began, by `perf_counter`."""

    def __init__(
        self, executor: Executor, folder: Path, start: float, reporter: Reporter, *, is_auxiliary: bool
    ) -> None:
        self._executor, self._folder, self._start = executor, folder, start
        self._reporter, self._is_auxiliary = reporter, is_auxiliary

    def render(self, prepared: PreparedFilm, *, force: bool) -> FilmResult:
        """Draw the film in one pass; frames that are finished are not drawn again."""
        assert prepared.stage is not None
        job, reporter = prepared.job, self._reporter
        plan = make_plan(LODCostEstimator(prepared.stage), job.frames, self._executor.rasterizer, reporter)
        prepared = replace(prepared, stage=None)  # its volume may move
        checkpoint = resume_checkpoint(prepared, plan, self._folder, reporter, force=force)
        num_missing = len(job.frames) - len(checkpoint.records)
        label = "drawing" if self._is_auxiliary else job.scene.output.file.name
        with deferrable_interrupts() as defer_interrupts:
            try:
                with self._executor.for_plan(plan, num_missing) as drawer:
                    del plan  # its volume may move
                    drawn = self._draw(job, drawer, label, defer_interrupts, checkpoint)
                    plan = drawer.plan
                film = finish_film(job, plan, drawn, prepared.fingerprint, self._folder)
            except BaseException:
                if not self._is_auxiliary:
                    report_resumable(checkpoint, job, self._folder, reporter, force=force)
                raise
            remove_checkpoint_frames(self._folder, job.scene.output, job.frames)
        return film

    def refine(self, prepared: PreparedFilm, refinement: Refinement) -> FilmResult:
        """Draw pass after pass, until one is what the scene requests or the time is up."""
        assert prepared.stage is not None and self._executor.rasterizer is not None
        job, file = prepared.job, prepared.job.scene.output.file
        deadline = math.inf if refinement.time_limit is None else self._start + refinement.time_limit
        estimator = LODCostEstimator(prepared.stage)
        refiner = Refiner(job, estimator, self._executor.rasterizer, deadline, self._reporter)
        film: FilmResult | None = None
        try:
            for plan, frame_seconds in refiner.plan_passes():
                start, label = time.perf_counter(), f"{file.name}, pass {len(refiner.passes) + 1}"
                with deferrable_interrupts() as defer_interrupts:
                    with self._executor.for_plan(plan, len(job.frames)) as drawer:
                        drawn = self._draw(job, drawer, label, defer_interrupts, refiner=refiner)
                    summary = refiner.finish_pass(drawn, frame_seconds, time.perf_counter() - start)
                    drawn = drawn._replace(passes=refiner.passes)
                    film = finish_film(job, plan, drawn, prepared.fingerprint, self._folder)
                    self._reporter.line(summary)
            if not plan.is_unfinished:
                remove_checkpoint_frames(self._folder, job.scene.output, job.frames, prepared.fingerprint.of)
        except DeadlineReached:
            pass
        except KeyboardInterrupt:
            if film is not None:
                self._reporter.line(f"{file} is whole, as pass {len(refiner.passes)} made it")
            if film is None or not refinement.best_effort:
                raise
        assert film is not None
        return film

    def _draw(
        self,
        job: Job,
        drawer: FrameExecutor,
        label: str,
        finishing: Callable[[], None],
        checkpoint: FrameCheckpoint | None = None,
        refiner: Refiner | None = None,
    ) -> DrawnPass:
        """Draw the frames that the checkpoint lacks, keep them there, and make the film of all frames.

        finishing: called before files get their final names.
        """
        output, finished = job.scene.output, checkpoint.records if checkpoint else {}
        missing = [number for number in job.frames if number not in finished]
        is_missing = frozenset(missing).__contains__
        has_film = checkpoint is None or not has_frame_files(output)  # frame files are those of the checkpoint
        records: list[Record] = []
        with contextlib.ExitStack() as stack:
            film = open_film(output, job.frames, staging_folder=self._folder, before_rename=finishing)
            write = stack.enter_context(film) if has_film else None
            bar = stack.enter_context(self._reporter.progress(len(missing), label=label))
            drawing = stack.enter_context(contextlib.closing(drawer.draw(missing)))

            def store(number: int, drawn: FrameResult | None) -> Record:
                """Store a frame that was drawn, or take that of the checkpoint for the film; return its record."""
                before = time.perf_counter()
                if drawn is None:
                    assert checkpoint is not None
                    record, picture = finished[number], checkpoint.picture(number)
                else:
                    record, picture = drawn.record, drawn.picture
                    if checkpoint is not None:
                        record = checkpoint.save_frame(number, picture.png, record)
                    elif has_frame_files(output):
                        record = {**record, "digest": bytes_digest(picture.png)}
                if write is not None:
                    write(number, picture)
                if refiner is not None:
                    refiner.comparison.add_frame(number, picture.pixels)
                if not (drawn or write):
                    return record
                return {**record, "seconds": {**record["seconds"], "encode": time.perf_counter() - before}}

            tasks = (partial(store, n, next(drawing) if is_missing(n) else None) for n in job.frames)
            # On a time budget each frame is stored before the next one is drawn: both count.
            stored = (task() for task in tasks) if drawer.plan.is_timing_dependent else run_overlapped(tasks)
            for record in stack.enter_context(contextlib.closing(stored)):
                records.append(record)
                if refiner is not None and record["frame"] != job.frames[-1]:
                    refiner.require_time()
                if is_missing(record["frame"]):
                    bar.advance(counted(record["splats"], job.scene.splat.primitive_name))
        if not has_film:
            finishing()
        elsewhere = [record["gl"] for record in records if "gl" in record]
        drivers = list(dict.fromkeys([*elsewhere, *drawer.drivers])) or [self._executor.renderer_name]
        notes = [*(film_notes(output) if has_film else ()), *drawer.notes]
        return DrawnPass(records, notes, drivers, time.perf_counter() - self._start, len(job.frames) - len(missing))
