"""A film that is finished: the sidecar beside it, and what is said about it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import click

from hsplat_cli.job import Job
from hsplat_cli.render.again import maker_notes
from hsplat_cli.render.cause import Marks
from hsplat_cli.render.goals import Plan, shortfall_of
from hsplat_cli.render.record import Record, film_record, schedule_record, summary, visibility_notes
from renderer.errors import RenderError
from renderer.kept_frames import file_digest
from renderer.output_files import has_frame_files, sidecar_path
from renderer.sidecar import write_sidecar
from renderer.staging import explained


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
        return sidecar_path(self.job.scene, self.job.frames)


def record(done: Done, folder: Path, *, cause: Mapping[str, Any] | None = None, passes: Sequence[Record] = ()) -> None:
    """Write the sidecar.

    folder: of what is not finished. cause: of the frames, by which the next job sees whether it has nothing to do.
    """
    content = film_record(done.plan.stage, done.frames, done.made_by)
    content |= {"schedule": schedule_record(done.job, done.plan, done.frames, done.shortfall)}
    content |= {"passes": list(passes)} if passes else {}
    content |= {"notes": done.notes, "seconds": done.plan.stage.seconds | {"total": done.seconds}}
    if cause is not None:
        output, file = done.job.scene.output, done.job.scene.output.file
        content |= {"cause": {**asdict(Marks.of(cause, output, done.job.frames)), "of": cause}}
        if not has_frame_files(output):
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
