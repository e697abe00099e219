"""One film: frames that are kept as they come, and the file that is made of them."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from hsplat_cli.executors import ExecutorSpec, FrameExecutor, FrameResult, open_executor
from hsplat_cli.films.background import run_overlapped, run_sequentially
from hsplat_cli.films.checkpoint import report_checkpoint, report_resumable, resume_checkpoint
from hsplat_cli.films.finished_film import FinishedFilm, record, tell
from hsplat_cli.films.goals import make_plan
from hsplat_cli.films.preparation import prepare_film
from hsplat_cli.films.sidecar_record import makers, with_seconds
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import Reporter, counted, deferrable_interrupts, progress
from renderer.errors import RenderError
from renderer.film import (
    FilmWriter,
    FrameCheckpoint,
    Record,
    has_frame_files,
    locked_output,
    open_film,
    remove_checkpoint_frames,
    require_encoder,
    sidecar_path,
)
from renderer.frame import LODCostEstimator


def render_once(
    job: Job,
    executor_spec: ExecutorSpec,
    *,
    place: Path | None = None,
    on_start: Callable[[], None] | None = None,
    force: bool = False,
    quiet: bool,
    is_auxiliary: bool = False,
) -> RenderError | None:
    """The film that the scene asks for, in one pass; what was asked for and not had.

    Frames that an earlier job finished are kept; with `force` they are drawn again.
    place: the folder of what is not finished, where the caller has taken the place of the output.
    on_start: called where the film is not there yet, before anything of it is.
    is_auxiliary: the film is a means to another end, in a new folder: nothing is said of it but how far the work is.
    """
    start, output, frames = time.perf_counter(), job.scene.output, job.frames
    with contextlib.ExitStack() as stack:
        # What can fail early does: the outputs, the encoder, and GL or a cluster are tried before a voxel is read.
        folder = place or stack.enter_context(locked_output(output, frames, sidecar_path(job.scene, frames)))
        defer_interrupts = stack.enter_context(deferrable_interrupts())
        require_encoder(output)
        executor = stack.enter_context(open_executor(executor_spec, job.scene, Reporter(quiet)))
        begun = prepare_film(job, folder, executor.renderer_name, force=force, quiet=quiet)
        if begun is None:
            return None
        if on_start is not None:
            on_start()
        plan = make_plan(LODCostEstimator(begun.stage), frames, executor.rasterizer, quiet=quiet)
        job, cause, before = begun.job, begun.cause, begun.before
        del begun  # its volume may move
        kept = resume_checkpoint(job, plan, folder, cause, before, force=force)
        if not quiet:
            report_checkpoint(kept, job, plan)
        num_kept = len(kept.records)
        label = "drawing" if is_auxiliary else output.file.name
        try:
            with executor.for_plan(plan, len(frames) - num_kept) as drawer:
                is_timing_dependent = plan.is_timing_dependent
                del plan  # its volume may move
                records, notes = _draw(
                    job,
                    kept,
                    drawer,
                    folder,
                    defer_interrupts,
                    is_timing_dependent=is_timing_dependent,
                    label=label,
                    quiet=quiet,
                )
                plan = drawer.plan
                notes = [*notes, *drawer.notes]
                made_by = list(dict.fromkeys([*makers(records), *drawer.drivers])) or [executor.renderer_name]
            seconds = time.perf_counter() - start
            done = FinishedFilm(job, plan, records, notes, made_by, seconds, num_kept)
            record(done, folder, cause)
        except BaseException:
            if not (quiet or is_auxiliary):
                report_resumable(kept, job, folder, cause, force=force)
            raise
        remove_checkpoint_frames(folder, output, frames)
    tell(done, quiet=quiet or is_auxiliary)
    return done.shortfall


def _draw(
    job: Job,
    kept: FrameCheckpoint,
    drawer: FrameExecutor,
    folder: Path,
    finishing: Callable[[], None],
    *,
    is_timing_dependent: bool,
    label: str,
    quiet: bool,
) -> tuple[list[Record], Sequence[str]]:
    """Draw the frames that are not there, keep them, and make the film of all; their records, and notes on the film."""
    output = job.scene.output
    missing = [number for number in job.frames if number not in kept.records]
    records: list[Record] = []
    notes: Sequence[str] = ()
    with contextlib.ExitStack() as stack:
        film = None
        if not has_frame_files(output):
            film = stack.enter_context(open_film(output, job.frames, within=folder, finishing=finishing))
            notes = film.notes
        bar = stack.enter_context(progress(len(missing), label=label, quiet=quiet))
        drawing = stack.enter_context(contextlib.closing(drawer.draw(missing)))
        missed = frozenset(missing)
        tasks = (partial(_store, kept, film, n, next(drawing) if n in missed else None) for n in job.frames)
        stored = run_sequentially(tasks) if is_timing_dependent else run_overlapped(tasks)
        for record in stack.enter_context(contextlib.closing(stored)):
            records.append(record)
            if record["frame"] in missed:
                bar.advance(counted(record["splats"], job.scene.splat.primitive_name))
    if film is None:
        finishing()
    return records, notes


def _store(kept: FrameCheckpoint, film: FilmWriter | None, number: int, drawn: FrameResult | None) -> Record:
    """Keep a frame that was drawn, or take the one that is kept, for the film, too; its record."""
    before = time.perf_counter()
    record = kept.records[number] if drawn is None else kept.keep(number, drawn.picture.png, drawn.record)
    if film is not None:
        picture = kept.picture(number) if drawn is None else drawn.picture
        film.write(number, picture.pixels)
    if drawn is None and film is None:
        return record
    return with_seconds(record, encode=time.perf_counter() - before)
