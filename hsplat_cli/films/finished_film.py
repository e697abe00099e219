"""A film that is finished: the sidecar beside it, and what is said about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import click

from hsplat_cli.films.fingerprint import JobFingerprint, fingerprint_record, with_digests
from hsplat_cli.films.goals import shortfall_of
from hsplat_cli.films.rerender import rerender_notes
from hsplat_cli.films.sidecar_record import driver_notes, schedule_record, summary
from hsplat_cli.scenes import Job
from renderer.errors import RenderError
from renderer.film import Record, sidecar_path, write_sidecar
from renderer.frame import film_record, visibility_notes
from renderer.study import FilmPlan


@dataclass(frozen=True)
class FinishedFilm:
    """A finished film: the records of its frames, what is to be said about its file, and what it took in all.

    made_by: devices and drivers, as GL names them. num_kept: frames that had been drawn before.
    """

    job: Job
    plan: FilmPlan
    frames: Sequence[Record]
    file_notes: Sequence[str]
    made_by: Sequence[str]
    seconds: float
    num_kept: int = 0

    @cached_property
    def shortfall(self) -> RenderError | None:
        """What was asked for and not had."""
        return shortfall_of(self.job, self.plan, self.frames)

    @property
    def notes(self) -> list[str]:
        """What the user should know."""
        return [
            *self.file_notes,
            *driver_notes(self.made_by),
            *rerender_notes(self.job, self.gl),
            *visibility_notes(self.frames),
        ]

    @property
    def gl(self) -> str:
        """What made it, as the sidecar tells it."""
        return " and ".join(self.made_by)

    @property
    def sidecar(self) -> Path:
        """The file that says how it was made."""
        return sidecar_path(self.job.scene, self.job.frames)


def record(done: FinishedFilm, folder: Path, cause: JobFingerprint, *, passes: Sequence[Record] = ()) -> None:
    """Write the sidecar.

    folder: of what is not finished. The next job sees by the `cause` that it has nothing to do; a film that one pass
    would not have made, a coarser one or one that was found on the clock without being asked to, has none. Pictures
    that are files have their digests in any case, for those of another film may take their places one by one.
    """
    job, frames = done.job, with_digests(done.frames, done.job.scene.output)
    schedule = schedule_record(job, done.plan, frames, done.shortfall)
    content = film_record(done.plan.stage, frames, done.gl) | {"schedule": schedule}
    content |= {"passes": list(passes)} if passes else {}
    content |= {"notes": done.notes, "seconds": done.plan.stage.seconds | {"total": done.seconds}}
    if not done.plan.is_unfinished and (schedule["reproducible"] or "seconds" in job.requested_error):
        content |= fingerprint_record(cause, job.scene.output)
    write_sidecar(done.sidecar, content | {"frames": frames}, folder)


def tell(done: FinishedFilm, *, quiet: bool) -> None:
    """Say what was made and what it cost, in a few lines."""
    if quiet:
        return
    click.echo(
        f"{done.job.scene.output.file}: {summary(done.job, done.frames, done.seconds, done.plan.found, done.num_kept)}"
    )
    for note in done.notes:
        click.echo(f"note: {note}")
    click.echo(f"how it was made: {done.sidecar}")
