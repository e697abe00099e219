"""Frames that an earlier job left finished: which of them a job goes on with, and what is said about them."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from hsplat_cli.films.cause import Cause, Made, made_before, reason
from hsplat_cli.scenes import Job, Plan
from hsplat_cli.terminal import counted
from renderer.film import KeptFrames, Record, has_frame_files, sidecar_path
from renderer.scene import tolerance_at


def find_kept(job: Job, plan: Plan, folder: Path, cause: Cause, before: Made | None, *, force: bool) -> KeptFrames:
    """Those of the job's frames that are there and are what would be drawn; none with `force`.

    before: what the sidecar tells that is there, which may be of frames that are. That of another film stays until this
    one has its own, also where frames take the place of its: it may be what this film is made from, and it has the
    digests of its pictures, so that no other is taken for one of them.
    """
    output = job.scene.output
    kept = KeptFrames(folder, output, job.frames, cause.of, afresh=force)
    if before is not None and has_frame_files(output) and before.has_frames_of(cause):
        kept.add_former(before.records)
    kept.drop(partial(_is_as_planned, plan))
    return kept


def _is_as_planned(plan: Plan, record: Record) -> bool:
    """Whether a frame that is kept has the tolerance that it would have now; one on a budget of time has any."""
    if plan.by_clock:
        return "predicted_seconds" in record
    return bool(record["tolerance"] == tolerance_at(plan.stage.scene.error, record["frame"]))


def tell_kept(kept: KeptFrames, job: Job, plan: Plan) -> None:
    """Say which frames are there already, and why others are not."""
    if kept.records:
        click.echo(f"{_some(kept, job)} there already", err=True)
    if kept.former_cause is not None:
        why = reason(kept.former_cause, kept.cause)
        click.echo(f"{_drawn_anew(kept.num_former)} of another film: {why}", err=True)
    if kept.num_dropped:
        why = "not drawn on a budget of time" if plan.by_clock else "drawn at other tolerances"
        click.echo(f"{_drawn_anew(kept.num_dropped)} {why}", err=True)


def _some(kept: KeptFrames, job: Job) -> str:
    """`1 of 5 frames is`, `4 of 5 frames are`."""
    num = len(kept.records)
    return f"{num} of {counted(len(job.frames), 'frame')} {'is' if num == 1 else 'are'}"


def _drawn_anew(num: int) -> str:
    if num == 1:
        return "1 frame that was there is drawn anew, for it was"
    return f"{num} frames that were there are drawn anew, for they were"


def tell_left(kept: KeptFrames, job: Job, folder: Path, cause: Cause, *, force: bool) -> None:
    """Say, when the work ends early, what remains of it."""
    if kept.records and folder.is_dir():
        command = "the same command"
        if force:
            command += f" without --force{_once_removed(job, cause)}"
        click.echo(f"{_some(kept, job)} kept; {command} goes on from there", err=True)


def _once_removed(job: Job, cause: Cause) -> str:
    """That a film in one file must go, where it is the very one, for with it there would be nothing to do."""
    output = job.scene.output
    before = None if has_frame_files(output) else made_before(sidecar_path(job.scene, job.frames), output)
    is_there = before is not None and before.is_up_to_date(cause, output, job.frames)
    return f", once {output.file} is removed," if is_there else ""
