"""Find what earlier jobs left of an output: a film that is up to date, or finished frames to resume from."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hsplat_cli.films.fingerprint import (
    JobFingerprint,
    describe_differences,
    describe_mismatch,
    job_fingerprint,
    recorded_fingerprint,
)
from hsplat_cli.scenes import Job, read_volume_guarded
from hsplat_cli.terminal import Reporter, counted
from renderer.film import (
    FrameCheckpoint,
    Record,
    file_matches_digest,
    frame_matches_digest,
    frame_path,
    has_frame_files,
    is_frame_record,
    remove_checkpoint_frames,
    sidecar_path,
    without_paths,
    write_sidecar,
)
from renderer.frame import Stage, prepare_stage
from renderer.scene import MAX_SIDECAR_BYTES, OutputSpec, read_json_object, schedule_to_dict, tolerance_at
from renderer.study import FilmPlan
from renderer.system import num_cores
from renderer.volume import Volume

_MAX_SECONDS = 1e10  # to draw a film; more is a mistake


# The film that is there


@dataclass(frozen=True)
class RecordedFilm:
    """A film as its sidecar describes it; anybody may have edited the sidecar.

    is_complete: whether the sidecar describes all frames, and they meet what was requested.
    frames: the records of the frames.
    data: the content of the sidecar, without paths where the output wants none. has_paths: whether the file has them
    nevertheless.
    """

    fingerprint: JobFingerprint
    is_complete: bool
    frames: Sequence[Record]
    data: Mapping[str, Any]
    has_paths: bool

    def why_stale(self, fingerprint: JobFingerprint, output: OutputSpec, frames: Sequence[int]) -> str | None:
        """Return why this film is not up to date, as the end of a sentence about it; None where it is.

        The reason is empty for numbered frames of the same fingerprint, which are kept or redrawn one by one.
        """
        change = None
        if self.fingerprint.frames != fingerprint.frames:
            change = describe_mismatch(self.fingerprint.of, fingerprint.of)
        elif self.fingerprint.film != fingerprint.film or [each["frame"] for each in self.frames] != [*frames]:
            change = describe_differences(self.fingerprint.film, fingerprint.film) or "it has other frames"
        if change is None and self.is_complete and self._is_unchanged(output):
            return None
        if has_frame_files(output):
            is_kept = self.fingerprint.frames == fingerprint.frames
            return "" if is_kept else f"is another film and is drawn again: {change}"
        if not output.file.exists():
            return f"does not exist, and its sidecar describes another film: {change}" if change else ""
        if change is not None:
            return f"is another film and is drawn again: {change}"
        why = "is not the file that its sidecar describes" if self.is_complete else "is less than what was requested"
        return f"{why} and is drawn again"

    def _is_unchanged(self, output: OutputSpec) -> bool:
        if not has_frame_files(output):
            return file_matches_digest(output.file, self.data.get("digest"))
        files = ((frame_path(output.file, each["frame"]), each["digest"]) for each in self.frames)
        return all(frame_matches_digest(path, digest, output) for path, digest in files)


def read_recorded_film(sidecar: Path, output: OutputSpec) -> RecordedFilm | None:
    """Return the film that the sidecar of an output describes, or None where there is no usable sidecar."""
    data = read_json_object(sidecar, MAX_SIDECAR_BYTES)
    if data is None:
        return None
    try:
        fingerprint, records = recorded_fingerprint(data), data["frames"]
        # A film in one file has no frame files, so its records need no digests.
        usable = [record for record in records if is_frame_record(record, has_digest=has_frame_files(output))]
        is_complete = data["schedule"]["met"] is True and len(usable) == len(records)
        is_complete &= 0 <= data["seconds"]["total"] < _MAX_SECONDS
        wanted = data if output.record_paths else without_paths(data)
    except (AttributeError, KeyError, TypeError):
        return None
    return None if fingerprint is None else RecordedFilm(fingerprint, is_complete, usable, wanted, wanted != data)


def keep_sidecar(recorded: RecordedFilm, sidecar: Path, folder: Path) -> None:
    """Take the paths that it should not have from the sidecar of a film that is up to date."""
    if recorded.has_paths:
        write_sidecar(sidecar, recorded.data, folder)


# The start of a film


@dataclass(frozen=True)
class PreparedFilm:
    """A job that is ready to draw.

    job: with the schedule that its film counts as requested for.
    recorded: the film that the existing sidecar describes, unless it is ignored.
    stage: None where the recorded film exists, complete and unchanged.
    """

    job: Job
    fingerprint: JobFingerprint
    recorded: RecordedFilm | None
    stage: Stage | None


def prepare_film(job: Job, folder: Path, driver: str, reporter: Reporter, *, force: bool) -> PreparedFilm:
    """Read the volume and prepare the stage, unless the film is up to date; say which.

    folder: for unfinished work. driver: device and driver, as OpenGL names them. force: ignore what exists.
    Raises what `read_volume` and `prepare` raise.
    """
    before_reading = time.perf_counter()
    volume = read_volume_guarded(job.scene.volume)
    read_seconds = time.perf_counter() - before_reading
    if volume.note is not None:
        reporter.status(f"{volume.name}: {volume.note}")
    job, fingerprint = _fingerprint_job(job, volume, driver)
    output = job.scene.output
    sidecar = sidecar_path(job.scene, job.frames)
    recorded = None if force else read_recorded_film(sidecar, output)
    why_stale = "" if recorded is None else recorded.why_stale(fingerprint, output, job.frames)
    if recorded is not None and why_stale is None:
        # Left by a job that was killed when its film was complete.
        remove_checkpoint_frames(folder, output, job.frames, fingerprint.of)
        keep_sidecar(recorded, sidecar, folder)
        reporter.status(f"{output.file} is up to date; --force draws it again")
        return PreparedFilm(job, fingerprint, recorded, None)
    stage = prepare_stage(
        job.scene,
        clock=time.perf_counter,
        num_threads=num_cores(),
        volume=volume,
        fingerprint=job.original.fingerprint if job.original else None,
        recorded_in=f"{job.original.path}: volume.fingerprint" if job.original else "",
    )
    stage = replace(stage, seconds={**stage.seconds, "read": stage.seconds["read"] + read_seconds})
    if why_stale:
        reporter.status(f"{output.file} {why_stale}")
    return PreparedFilm(job, fingerprint, recorded, stage)


def _fingerprint_job(job: Job, volume: Volume, driver: str) -> tuple[Job, JobFingerprint]:
    """Return the job and its fingerprint.

    A film that is rendered from its sidecar meets what the original was requested to meet only if the fingerprints
    agree. Otherwise nobody has measured it, and it counts as requested at the tolerances in the sidecar.
    """
    fingerprint = job_fingerprint(job, volume.fingerprint, driver)
    if job.original is None or job.original.frames_fingerprint == fingerprint.frames:
        return job, fingerprint
    job = replace(job, requested_error=schedule_to_dict(job.scene.error))
    return job, job_fingerprint(job, volume.fingerprint, driver)


# Frames that are there


def resume_checkpoint(
    prepared: PreparedFilm, plan: FilmPlan, folder: Path, reporter: Reporter, *, force: bool
) -> FrameCheckpoint:
    """Return the job's finished frames that equal what would be drawn; report which, and why others do not.

    None are used with `force`. The sidecar of another film stays until this film has its own, even while frames of
    this film replace its frames: this film may be made from it, and its digests expose the mixture.
    """
    job, fingerprint, recorded = prepared.job, prepared.fingerprint, prepared.recorded
    output = job.scene.output
    checkpoint = FrameCheckpoint(folder, output, job.frames, fingerprint.of, discard_existing=force)
    if recorded is not None and recorded.fingerprint.frames == fingerprint.frames and has_frame_files(output):
        checkpoint.adopt_records(recorded.frames)
    dropped = [number for number, record in checkpoint.records.items() if not _matches_plan(plan, record)]
    for number in dropped:
        del checkpoint.records[number]
    if checkpoint.records:
        reporter.status(f"{_num_frames_text(checkpoint, job)} already finished")
    if checkpoint.former_fingerprint is not None:
        why = describe_mismatch(checkpoint.former_fingerprint, checkpoint.fingerprint)
        reporter.status(f"{_redrawn_text(checkpoint.num_outdated, 'of another film')}: {why}")
    if dropped:
        which = "not drawn on a time budget" if plan.is_timing_dependent else "drawn at other tolerances"
        reporter.status(_redrawn_text(len(dropped), which))
    return checkpoint


def _matches_plan(plan: FilmPlan, record: Record) -> bool:
    """Return whether a finished frame has the tolerance that it would have now; with a time budget it may have any."""
    if plan.is_timing_dependent:
        return "predicted_seconds" in record
    return bool(record["tolerance"] == tolerance_at(plan.stage.scene.error, record["frame"]))


def report_resumable(checkpoint: FrameCheckpoint, job: Job, folder: Path, reporter: Reporter, *, force: bool) -> None:
    """Report, when the work ends early, which frames are kept and which command resumes."""
    file = job.scene.output.file
    if checkpoint.records and folder.is_dir():
        command = "the same command" + " without --force" * force
        if force and not has_frame_files(job.scene.output) and file.exists():  # it may be up to date
            command += f", once {file} is removed,"
        reporter.status(f"{_num_frames_text(checkpoint, job)} kept; {command} resumes there")


def _num_frames_text(checkpoint: FrameCheckpoint, job: Job) -> str:
    """Return `1 of 5 frames is`, `4 of 5 frames are`."""
    num = len(checkpoint.records)
    return f"{num} of {counted(len(job.frames), 'frame')} {'is' if num == 1 else 'are'}"


def _redrawn_text(num: int, which: str) -> str:
    return f"{counted(num, 'existing frame')} {which} {'is' if num == 1 else 'are'} drawn again"
