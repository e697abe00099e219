"""One film: frames drawn into a file that is complete or not there, and the sidecar beside it."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import click

from hsplat_cli.interrupts import deferrable_interrupts
from hsplat_cli.job import Job
from hsplat_cli.progress import progress
from hsplat_cli.render.again import maker_notes
from hsplat_cli.render.goals import Plan, make_plan, shortfall_of
from hsplat_cli.render.record import film_record, frame_record, schedule_record, summary, visibility_notes
from renderer.costs import CostLog
from renderer.drawing import Frame, Rasterizer, Stage
from renderer.errors import RenderError
from renderer.film import FilmWriter, open_film
from renderer.output_files import sidecar_path
from renderer.pacing import Details
from renderer.pipeline import prepare, render_frames
from renderer.raster_gl import GLRasterizer
from renderer.sidecar import write_sidecar
from renderer.staging import require_writable


@dataclass(frozen=True)
class Done:
    """A finished film: the records of its frames, what is to be said about its file, and what it took in all."""

    job: Job
    plan: Plan
    frames: Sequence[dict[str, Any]]
    file_notes: Sequence[str]
    made_by: str
    seconds: float

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
        return sidecar_path(self.job.scene, self.job.frames)


def render_once(job: Job, *, quiet: bool) -> RenderError | None:
    """The film that the scene asks for, in one pass; what was asked for and not had."""
    output, start = job.scene.output, time.perf_counter()
    with deferrable_interrupts() as defer_interrupts:
        # What can fail early does: the outputs and the GL context are tried before a voxel is read.
        with open_film(output, job.frames, finishing=defer_interrupts) as film, GLRasterizer() as rasterizer:
            require_writable(sidecar_path(job.scene, job.frames))
            details = Details(prepare_job(job), CostLog())
            plan = make_plan(details, job.frames, rasterizer, quiet=quiet)
            frames = draw_film(plan, job.frames, film, rasterizer, label=output.file.name, quiet=quiet)
            made_by = rasterizer.renderer_name
        done = Done(job, plan, frames, film.notes, made_by, time.perf_counter() - start)
        record(done)
    tell(done, quiet=quiet)
    return done.shortfall


def prepare_job(job: Job) -> Stage:
    """The job's stage, on all cores."""
    return prepare(
        job.scene,
        clock=time.perf_counter,
        num_threads=os.cpu_count() or 1,
        fingerprint=job.original.fingerprint if job.original else None,
        recorded_in=f"{job.original.path}: volume.fingerprint" if job.original else "",
    )


def draw_film(
    plan: Plan,
    numbers: Sequence[int],
    film: FilmWriter,
    rasterizer: Rasterizer,
    *,
    label: str,
    quiet: bool,
    on_frame: Callable[[Frame], None] = lambda frame: None,
) -> list[dict[str, Any]]:
    """Draw the frames into the film; a record of each. `on_frame` is called with each frame that was written."""
    records = []
    with progress(len(numbers), label=label, quiet=quiet) as bar:
        for frame in render_frames(plan.stage, numbers, rasterizer, clock=time.perf_counter, guide=plan.guide):
            before = time.perf_counter()
            film.write(frame.number, frame.image)
            records.append(frame_record(frame, time.perf_counter() - before))
            on_frame(frame)
            bar.advance(f"{frame.num_splats} splats")
    return records


def record(done: Done, passes: Sequence[dict[str, Any]] = ()) -> None:
    """Write the sidecar."""
    content = film_record(done.plan.stage, done.frames, done.made_by)
    content |= {"schedule": schedule_record(done.job, done.plan, done.frames, done.shortfall)}
    content |= {"passes": list(passes)} if passes else {}
    content |= {"notes": done.notes, "seconds": done.plan.stage.seconds | {"total": done.seconds}}
    write_sidecar(done.sidecar, content | {"frames": done.frames})


def tell(done: Done, *, quiet: bool) -> None:
    """Say what was made and what it cost, in a few lines."""
    if quiet:
        return
    click.echo(f"{done.job.scene.output.file}: {summary(done.job, done.frames, done.seconds, done.plan.found)}")
    for note in done.notes:
        click.echo(f"note: {note}")
    click.echo(f"how it was made: {done.sidecar}")
