"""One film: frames that are kept as they come, the file that is made of them, and the sidecar beside it."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property, partial
from pathlib import Path

import click

from hsplat_cli.drawn import Drawn
from hsplat_cli.interrupts import deferrable_interrupts
from hsplat_cli.job import Job
from hsplat_cli.progress import progress
from hsplat_cli.render.again import maker_notes
from hsplat_cli.render.cause import Marks, cause_of_frames, differences, made_before
from hsplat_cli.render.crew import Crew, draw_frames
from hsplat_cli.render.goals import Plan, make_plan, shortfall_of
from hsplat_cli.render.place import taken
from hsplat_cli.render.record import Record, film_record, schedule_record, summary, visibility_notes, with_seconds
from renderer.costs import CostLog
from renderer.drawing import Rasterizer, Stage
from renderer.errors import RenderError
from renderer.film import open_film, require_encoder
from renderer.kept_frames import KeptFrames, file_digest, forget_frames
from renderer.output_files import has_frame_files, sidecar_path
from renderer.pacing import Details
from renderer.pipeline import prepare
from renderer.raster_gl import GLRasterizer
from renderer.readers import read_volume
from renderer.schedule import tolerance_at
from renderer.sidecar import write_sidecar
from renderer.staging import explained
from renderer.volume import Volume


@dataclass(frozen=True)
class Done:
    """A finished film: the records of its frames, what is to be said about its file, and what it took in all.

    num_kept: frames that had been drawn before.
    """

    job: Job
    plan: Plan
    frames: Sequence[Record]
    file_notes: Sequence[str]
    made_by: str
    seconds: float
    num_kept: int = 0

    @cached_property
    def shortfall(self) -> RenderError | None:
        """What was asked for and not had."""
        return shortfall_of(self.job, self.plan, self.frames)

    @property
    def notes(self) -> list[str]:
        """What the user should know."""
        return [*self.file_notes, *maker_notes(self.job, self.made_by), *visibility_notes(self.frames)]

    @property
    def sidecar(self) -> Path:
        """The file that says how it was made."""
        return sidecar_path(self.job.scene.output.file)


def render_once(job: Job, crew: Crew, *, force: bool = False, quiet: bool) -> RenderError | None:
    """The film that the scene asks for, in one pass; what was asked for and not had.

    Frames that an earlier job finished are kept; with `force` they are drawn again.
    """
    start, output = time.perf_counter(), job.scene.output
    with taken(job) as folder, deferrable_interrupts() as defer_interrupts:
        # What can fail early does: the outputs, the encoder and the GL context are tried before a voxel is read.
        require_encoder(output)
        with GLRasterizer() as rasterizer:
            volume = read_volume(job.scene.volume)
            cause = cause_of_frames(job, volume, rasterizer.renderer_name)
            marks = Marks.of(cause, output, job.frames)
            before = None if force else made_before(output)
            if before is not None and before.is_up_to_date(marks, output, job.frames):
                forget_frames(folder, output, job.frames)  # of a job that was killed when its film was whole
                _say(f"{output.file} is up to date; --force draws it again", quiet=quiet)
                return None
            details = Details(prepare_job(job, volume), CostLog())
            plan = make_plan(details, job.frames, rasterizer, quiet=quiet)
            kept = KeptFrames(folder, output, job.frames, cause, afresh=force)
            if before is not None and before.marks.frames == marks.frames and has_frame_files(output):
                kept.add_former(before.records)
            kept.drop(partial(_is_as_planned, plan))
            num_kept = _tell_kept(kept, job, quiet=quiet)
            try:
                frames, notes = _draw(job, plan, kept, folder, rasterizer, crew, defer_interrupts, quiet=quiet)
                made_by, seconds = rasterizer.renderer_name, time.perf_counter() - start
                done = Done(job, plan, frames, notes, made_by, seconds, num_kept)
                record(done, folder, marks=marks)
            except BaseException:
                _tell_left(kept, job, folder, force=force, quiet=quiet)
                raise
        forget_frames(folder, output, job.frames)
    tell(done, quiet=quiet)
    return done.shortfall


def _is_as_planned(plan: Plan, record: Record) -> bool:
    """Whether a frame that is kept has the tolerance that it would have now; one on a budget of time has any."""
    if plan.by_clock:
        return "predicted_seconds" in record
    return bool(record["tolerance"] == tolerance_at(plan.stage.scene.error, record["frame"]))


def _tell_kept(kept: KeptFrames, job: Job, *, quiet: bool) -> int:
    """Say which frames are there already, and why others are not; how many of the job's there are."""
    num_kept = len(kept.records)
    if num_kept:
        _say(f"{num_kept} of {len(job.frames)} frames are there already", quiet=quiet)
    if kept.former_cause is not None:
        why = differences(kept.former_cause, kept.cause)
        _say(
            f"{kept.num_former} frames that were there are drawn anew, for they were of another film: {why}",
            quiet=quiet,
        )
    return num_kept


def _tell_left(kept: KeptFrames, job: Job, folder: Path, *, force: bool, quiet: bool) -> None:
    """Say, when the work ends early, what remains of it."""
    if kept.records and folder.is_dir():
        command = "the same command without --force" if force else "the same command"
        _say(f"{len(kept.records)} of {len(job.frames)} frames are kept; {command} goes on from there", quiet=quiet)


def _say(text: str, *, quiet: bool) -> None:
    if not quiet:
        click.echo(text, err=True)


def prepare_job(job: Job, volume: Volume | None = None) -> Stage:
    """The job's stage, on all cores; of its `volume`, if it was read already."""
    return prepare(
        job.scene,
        clock=time.perf_counter,
        num_threads=os.cpu_count() or 1,
        volume=volume,
        fingerprint=job.original.fingerprint if job.original else None,
        recorded_in=f"{job.original.path}: volume.fingerprint" if job.original else "",
    )


def _draw(
    job: Job,
    plan: Plan,
    kept: KeptFrames,
    folder: Path,
    rasterizer: Rasterizer,
    crew: Crew,
    finishing: Callable[[], None],
    *,
    quiet: bool,
) -> tuple[list[Record], Sequence[str]]:
    """Draw the frames that are not there, keep them, and make the film of all; their records, and notes on the film."""
    output = job.scene.output
    missing = [number for number in job.frames if number not in kept.records]
    records: list[Record] = []
    notes: tuple[str, ...] = ()
    with contextlib.ExitStack() as stack:
        film = None
        if not has_frame_files(output):
            film = stack.enter_context(open_film(output, job.frames, within=folder, finishing=finishing))
            notes = film.notes
        bar = stack.enter_context(progress(len(missing), label=output.file.name, quiet=quiet))
        drawing = stack.enter_context(contextlib.closing(draw_frames(plan, missing, rasterizer, crew)))
        for number in job.frames:
            is_new = number not in kept.records
            drawn = next(drawing) if is_new else Drawn(number, kept.picture(number), dict(kept.records[number]))
            before = time.perf_counter()
            record = kept.keep(number, drawn.picture.png, drawn.record) if is_new else drawn.record
            if film is not None:
                film.write(number, drawn.picture.pixels)
            if is_new or film is not None:
                record = with_seconds(record, encode=time.perf_counter() - before)
            records.append(record)
            if is_new:
                bar.advance(f"{record['splats']} splats")
    if film is None:
        finishing()
    return records, notes


def record(done: Done, folder: Path, *, marks: Marks | None = None, passes: Sequence[Record] = ()) -> None:
    """Write the sidecar.

    folder: of what is not finished. marks: by which the next job sees that it has nothing to do.
    """
    content = film_record(done.plan.stage, done.frames, done.made_by)
    content |= {"schedule": schedule_record(done.job, done.plan, done.frames, done.shortfall)}
    content |= {"passes": list(passes)} if passes else {}
    content |= {"notes": done.notes, "seconds": done.plan.stage.seconds | {"total": done.seconds}}
    if marks is not None:
        content |= {"cause": asdict(marks)}
        file = done.job.scene.output.file
        if not has_frame_files(done.job.scene.output):
            with explained(file):
                content |= {"digest": file_digest(file)}
    write_sidecar(done.sidecar, content | {"frames": done.frames}, folder)


def tell(done: Done, *, quiet: bool) -> None:
    """Say what was made and what it cost, in a few lines."""
    if quiet:
        return
    click.echo(
        f"{done.job.scene.output.file}: {summary(done.job, done.frames, done.seconds, done.plan.found, done.num_kept)}"
    )
    for note in done.notes:
        click.echo(f"note: {note}")
    click.echo(f"how it was made: {done.sidecar}")
