"""Frames that an earlier job left finished: which of them a job goes on with, and what is said about them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from hsplat_cli.films.fingerprint import JobFingerprint, Made, read_recorded_film, reason
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import counted
from renderer.film import FrameCheckpoint, Record, has_frame_files, sidecar_path
from renderer.scene import tolerance_at
from renderer.study import FilmPlan


def resume_checkpoint(
    job: Job, plan: FilmPlan, folder: Path, cause: JobFingerprint, before: Made | None, *, force: bool
) -> FrameCheckpoint:
    """Those of the job's frames that are there and are what would be drawn; none with `force`.

    before: what the sidecar tells that is there, which may be of frames that are. That of another film stays until this
    one has its own, also where frames take the place of its: it may be what this film is made from, and it has the
    digests of its pictures, so that no other is taken for one of them.
    """
    output = job.scene.output
    kept = FrameCheckpoint(folder, output, job.frames, cause.of, afresh=force)
    if before is not None and has_frame_files(output) and before.has_same_frames(cause):
        kept.adopt_records(before.records)
    kept.drop(partial(_matches_plan, plan))
    return kept


def _matches_plan(plan: FilmPlan, record: Record) -> bool:
    """Whether a frame that is kept has the tolerance that it would have now; one on a budget of time has any."""
    if plan.is_timing_dependent:
        return "predicted_seconds" in record
    return bool(record["tolerance"] == tolerance_at(plan.stage.scene.error, record["frame"]))


def report_checkpoint(kept: FrameCheckpoint, job: Job, plan: FilmPlan) -> None:
    """Say which frames are there already, and why others are not."""
    if kept.records:
        click.echo(f"{_some(kept, job)} there already", err=True)
    if kept.former_fingerprint is not None:
        why = reason(kept.former_fingerprint, kept.cause)
        click.echo(f"{_redrawn_text(kept.num_outdated)} of another film: {why}", err=True)
    if kept.num_dropped:
        why = "not drawn on a budget of time" if plan.is_timing_dependent else "drawn at other tolerances"
        click.echo(f"{_redrawn_text(kept.num_dropped)} {why}", err=True)


def _some(kept: FrameCheckpoint, job: Job) -> str:
    """`1 of 5 frames is`, `4 of 5 frames are`."""
    num = len(kept.records)
    return f"{num} of {counted(len(job.frames), 'frame')} {'is' if num == 1 else 'are'}"


def _redrawn_text(num: int) -> str:
    if num == 1:
        return "1 frame that was there is drawn anew, for it was"
    return f"{num} frames that were there are drawn anew, for they were"


def report_resumable(kept: FrameCheckpoint, job: Job, folder: Path, cause: JobFingerprint, *, force: bool) -> None:
    """Say, when the work ends early, what remains of it."""
    if kept.records and folder.is_dir():
        command = "the same command"
        if force:
            command += f" without --force{_removal_hint(job, cause)}"
        click.echo(f"{_some(kept, job)} kept; {command} goes on from there", err=True)


def _removal_hint(job: Job, cause: JobFingerprint) -> str:
    """That a film in one file must go, where it is the very one, for with it there would be nothing to do."""
    output = job.scene.output
    before = None if has_frame_files(output) else read_recorded_film(sidecar_path(job.scene, job.frames), output)
    is_there = before is not None and before.is_up_to_date(cause, output, job.frames)
    return f", once {output.file} is removed," if is_there else ""
