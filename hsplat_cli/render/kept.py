"""Frames that an earlier job left finished: which of them a job goes on with, and what is said about them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import click

from hsplat_cli.job import Job
from hsplat_cli.render.cause import Made, Marks, differences
from hsplat_cli.render.goals import Plan
from hsplat_cli.render.record import Record
from renderer.kept_frames import KeptFrames
from renderer.output_files import has_frame_files, sidecar_path
from renderer.schedule import tolerance_at


def find_kept(
    job: Job, plan: Plan, folder: Path, cause: Mapping[str, Any], marks: Marks, before: Made | None, *, force: bool
) -> KeptFrames:
    """Those of the job's frames that are there and are what would be drawn; none with `force`.

    before: what the sidecar tells that is there, which may be of frames that are.
    """
    output = job.scene.output
    kept = KeptFrames(folder, output, job.frames, cause, afresh=force)
    if before is not None and before.marks.frames == marks.frames and has_frame_files(output):
        kept.add_former(before.records)
    kept.drop(partial(_is_as_planned, plan))
    return kept


def _is_as_planned(plan: Plan, record: Record) -> bool:
    """Whether a frame that is kept has the tolerance that it would have now; one on a budget of time has any."""
    if plan.by_clock:
        return "predicted_seconds" in record
    return bool(record["tolerance"] == tolerance_at(plan.stage.scene.error, record["frame"]))


def tell_kept(kept: KeptFrames, job: Job) -> None:
    """Say which frames are there already, and why others are not."""
    if kept.records:
        click.echo(f"{len(kept.records)} of {len(job.frames)} frames are there already", err=True)
    if kept.former_cause is not None:
        why = f": {differences(kept.former_cause, kept.cause)}" if kept.former_cause else ""
        what = "frames that were there are drawn anew, for they were of another film"
        click.echo(f"{kept.num_former} {what}{why}", err=True)


def replace_former(job: Job, before: Made | None, marks: Marks, cause: Mapping[str, Any], *, quiet: bool) -> None:
    """Say that the output is that of another film, if it is, and how that differs.

    The sidecar of numbered frames goes: from now on some of them will be of the one film and some of the other.
    """
    output = job.scene.output
    if before is None or before.marks.frames == marks.frames:
        return
    if not quiet:
        why = f": {differences(before.cause, cause)}" if isinstance(before.cause, dict) else ""
        click.echo(f"{output.file} is drawn anew, for what is there is another film{why}", err=True)
    if has_frame_files(output):
        sidecar_path(job.scene, job.frames).unlink(missing_ok=True)


def tell_left(kept: KeptFrames, job: Job, folder: Path, *, force: bool) -> None:
    """Say, when the work ends early, what remains of it."""
    if kept.records and folder.is_dir():
        command = "the same command without --force" if force else "the same command"
        num = f"{len(kept.records)} of {len(job.frames)} frames"
        click.echo(f"{num} are kept; {command} goes on from there", err=True)
