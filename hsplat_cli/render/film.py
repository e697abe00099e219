"""One film: frames drawn into a file that is complete or not there, and the sidecar beside it."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import click

from hsplat_cli.job import Job
from hsplat_cli.progress import progress
from hsplat_cli.render.goals import Plan, shortfall_of
from hsplat_cli.render.record import film_record, frame_record, schedule_record, summary, visibility_notes
from renderer.drawing import Rasterizer, Stage
from renderer.errors import RenderError
from renderer.film import FilmWriter
from renderer.output_files import sidecar_path
from renderer.pipeline import prepare, render_frames
from renderer.sidecar import write_sidecar


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
        return shortfall_of(self.plan, self.frames)

    @property
    def notes(self) -> list[str]:
        """What the user should know."""
        return [*self.file_notes, *visibility_notes(self.frames)]


def prepare_job(job: Job) -> Stage:
    """The job's stage, on all cores."""
    num_threads = os.cpu_count() or 1
    return prepare(job.scene, clock=time.perf_counter, num_threads=num_threads, fingerprint=job.fingerprint)


def draw_film(
    plan: Plan, frames: Sequence[int], film: FilmWriter, rasterizer: Rasterizer, *, label: str, quiet: bool
) -> list[dict[str, Any]]:
    """Draw the frames into the film; a record of each."""
    records = []
    with progress(len(frames), label=label, quiet=quiet) as bar:
        for frame in render_frames(plan.stage, frames, rasterizer, clock=time.perf_counter, pacer=plan.pacer):
            before = time.perf_counter()
            film.write(frame.number, frame.image)
            records.append(frame_record(frame, time.perf_counter() - before))
            bar.advance(f"{frame.num_splats} splats")
    return records


def publish(done: Done, *, quiet: bool) -> None:
    """Write the sidecar, and say what was made and what it cost."""
    job = done.job
    sidecar = sidecar_path(job.scene.output.file)
    record = film_record(done.plan.stage, done.frames, done.made_by)
    record |= {"schedule": schedule_record(job, done.frames, done.shortfall, done.plan.found), "notes": done.notes}
    record |= {"seconds": done.plan.stage.seconds | {"total": done.seconds}, "frames": done.frames}
    write_sidecar(sidecar, record)
    if quiet:
        return
    click.echo(f"{job.scene.output.file}: {summary(job, done.frames, done.seconds, done.plan.found)}")
    for note in done.notes:
        click.echo(f"note: {note}")
    click.echo(f"how it was made: {sidecar}")
