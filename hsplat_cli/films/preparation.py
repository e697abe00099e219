"""The start of a film: whether it is there already, and if not, what is."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path

import click

from hsplat_cli.films.fingerprint import JobFingerprint, Made, job_fingerprint, read_recorded_film
from hsplat_cli.scenes import Job, read_volume_guarded
from renderer.cores import num_cores
from renderer.film import remove_checkpoint_frames, sidecar_path
from renderer.frame import Stage, prepare_stage
from renderer.scene import schedule_to_dict
from renderer.volume import Volume


@dataclass(frozen=True)
class Start:
    """job: with what its film counts as asked for. cause: of the film.

    before: what is told of the one that is there, if that is of any use.
    """

    job: Job
    stage: Stage
    cause: JobFingerprint
    before: Made | None


def prepare_film(job: Job, folder: Path, made_by: str, *, force: bool, quiet: bool) -> Start | None:
    """Read the volume; None where its film is there, else what it takes to draw it. Either is said.

    folder: of what is not finished. made_by: device and driver, as GL names them. force: what is there is of no use.
    Raises what `read_volume` and `prepare` raise.
    """
    before_reading = time.perf_counter()
    volume = read_volume_guarded(job.scene.volume)
    read_seconds = time.perf_counter() - before_reading
    if volume.note is not None and not quiet:
        click.echo(f"{volume.name}: {volume.note}", err=True)
    job, cause = _fingerprint_job(job, volume, made_by)
    output = job.scene.output
    before = None if force else read_recorded_film(sidecar_path(job.scene, job.frames), output)
    if before is not None and before.is_up_to_date(cause, output, job.frames):
        remove_checkpoint_frames(
            folder, output, job.frames, cause.of
        )  # of a job that was killed when its film was whole
        if not quiet:
            click.echo(f"{output.file} is up to date; --force draws it again", err=True)
        return None
    stage = _prepare(job, volume, read_seconds)
    why = None if before is None else before.why_rerender(cause, output, job.frames)
    if why is not None and not quiet:
        click.echo(f"{output.file} {why}", err=True)
    return Start(job, stage, cause, before)


def _fingerprint_job(job: Job, volume: Volume, made_by: str) -> tuple[Job, JobFingerprint]:
    """The job and what its film depends on.

    A film that is made again meets what the one before was asked for where it depends on the very same. For others
    nobody has measured that: they are asked for at the tolerances that the sidecar has.
    """
    cause = job_fingerprint(job, volume.fingerprint, made_by)
    if job.original is None or job.original.frames_fingerprint == cause.frames:
        return job, cause
    job = replace(job, requested_error=schedule_to_dict(job.scene.error))
    return job, job_fingerprint(job, volume.fingerprint, made_by)


def _prepare(job: Job, volume: Volume, read_seconds: float) -> Stage:
    """The job's stage, on all cores, of its volume, which took so long to read."""
    stage = prepare_stage(
        job.scene,
        clock=time.perf_counter,
        num_threads=num_cores(),
        volume=volume,
        fingerprint=job.original.fingerprint if job.original else None,
        recorded_in=f"{job.original.path}: volume.fingerprint" if job.original else "",
    )
    return replace(stage, seconds={**stage.seconds, "read": stage.seconds["read"] + read_seconds})
