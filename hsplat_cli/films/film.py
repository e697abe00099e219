"""Write the sidecar of a film that was drawn, and report the film."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from hsplat_cli.films.fingerprint import JobFingerprint, fingerprint_record
from hsplat_cli.films.goals import shortfall_of
from hsplat_cli.films.sidecar_record import (
    driver_notes,
    job_schedule_record,
    rerender_notes,
    summary_parts,
)
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import Reporter
from renderer.errors import RenderError
from renderer.film import Record, sidecar_path, write_sidecar
from renderer.frame import film_record, visibility_notes
from renderer.study import FilmPlan


@dataclass(frozen=True)
class FilmResult:
    """A finished film.

    file: the film, or the template of its frames.
    record: the content of the sidecar. It is that of an earlier job, unchecked but for the frames, where the film was
        up to date; then `summary` is empty.
    summary: what was made and what it cost, for the terminal.
    shortfall: what was requested and not reached.
    """

    file: Path
    sidecar: Path
    record: Mapping[str, Any]
    summary: str = ""
    shortfall: RenderError | None = None

    def report(self, reporter: Reporter) -> None:
        """Print what was made and what it cost, in a few lines."""
        reporter.line(f"{self.file}: {self.summary}")
        for note in self.record["notes"]:
            reporter.note(note)
        reporter.line(f"how it was made: {self.sidecar}")


class DrawnPass(NamedTuple):
    """A pass whose frames are drawn and in the film.

    notes: what the user should know. drivers: devices and drivers, as OpenGL names them. seconds: since the start of
    the job. num_resumed: frames that an earlier job had drawn. passes: records of the passes of a progressive film.
    """

    frames: Sequence[Record]
    notes: Sequence[str]
    drivers: Sequence[str]
    seconds: float
    num_resumed: int
    passes: Sequence[Record] = ()


def finish_film(job: Job, plan: FilmPlan, drawn: DrawnPass, fingerprint: JobFingerprint, folder: Path) -> FilmResult:
    """Write the sidecar of a film that was drawn, and return the film. folder: for unfinished work.

    The sidecar has the fingerprint, by which the next job sees that the film is up to date, unless a single pass would
    not have made this film: a coarser pass, or one whose tolerances depend on the clock though no time budget was
    requested. Frames in files have digests in any case, because frames of another film may replace them one by one.
    """
    output, driver = job.scene.output, " and ".join(drawn.drivers)
    frames, shortfall = drawn.frames, shortfall_of(job, plan, drawn.frames)
    schedule = job_schedule_record(job, plan, frames, shortfall)
    notes = [
        *drawn.notes,
        *driver_notes(drawn.drivers),
        *rerender_notes(job, driver),
        *visibility_notes(frames),
    ]
    record = film_record(plan.stage, frames, driver) | {"schedule": schedule}
    record |= {"passes": list(drawn.passes)} if drawn.passes else {}
    record |= {"notes": notes, "seconds": plan.stage.seconds | {"total": drawn.seconds}}
    if not plan.is_unfinished and (schedule["reproducible"] or "seconds" in job.requested_error):
        record |= fingerprint_record(fingerprint, output)
    record |= {"frames": frames}
    sidecar = sidecar_path(job.scene, job.frames)
    write_sidecar(sidecar, record, folder)
    summary = ", ".join(summary_parts(job, frames, drawn.seconds, plan.found, drawn.num_resumed))
    return FilmResult(output.file, sidecar, record, summary, shortfall)
