"""Verify a finished film by its files and its sidecar alone: whether it is whole, of which inputs, and how exact."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from renderer.errors import HsplatError, InputError, Problem
from renderer.film import (
    Picture,
    data_digest,
    decode_known_film,
    file_matches_digest,
    frame_path,
    has_frame_files,
    picture_shape,
)
from renderer.frame import read_film_volumes
from renderer.job.assemble.agreement import PickedFrame, file_problems
from renderer.job.assemble.parts import Part, problem_of
from renderer.job.events import JobEvents
from renderer.job.film_job import FilmJob, OriginalFilm
from renderer.job.film_making import open_job_stage
from renderer.job.fingerprint import describe_mismatch, film_fingerprint
from renderer.job.make_record import changed_tools
from renderer.job.record import FrameRecord
from renderer.job.verified_accuracy import MOST_RAYS, MeasuredFilm, RayOptions, measure_film
from renderer.scene import OutputSpec, counted
from renderer.system import package_versions, sources_digest


@dataclass(frozen=True)
class FilmFiles:
    """A summary of the files of a film, by their digests and by decoding them.

    problems: what differs from the sidecar. readable: the frames that have pictures. notes: what is not known.
    """

    problems: Sequence[Problem]
    readable: Sequence[FrameRecord]
    notes: Sequence[str]


@dataclass(frozen=True)
class VerifiedFilm:
    """A film whose volume is the recorded one, verified. measured: None where nothing could be measured."""

    problems: Sequence[Problem]
    notes: Sequence[str]
    measured: MeasuredFilm | None


def verify_files(original: OriginalFilm, output: OutputSpec) -> FilmFiles:
    """Look at all files of a film, wherever it is now, and decode them. Raises RenderError where ffmpeg is missing."""
    frames, notes = original.record.frames, list[str]()
    if has_frame_files(output):
        known = [frame for frame in frames if frame.digest is not None]
        if len(known) < len(frames):
            notes.append(f"{counted(len(frames) - len(known), 'frame')} of unknown digest may have been changed")
        part = Part(original.path, original.record, output.file)
        problems = [*file_problems([PickedFrame(each.frame, part, each) for each in known], picture_shape(output))]
        readable = [frame for frame in frames if _has_picture(frame, output)]
        if len(readable) < len(frames) and not problems:
            what = f"{counted(len(frames) - len(readable), 'frame')} cannot be decoded"
            problems.append(Problem("", what, location=str(output.file)))
        return FilmFiles(problems, readable, notes)
    problems = []
    if original.record.digest is None:
        notes.append("the digest of the film is not recorded: the file may have been changed")
    elif output.file.is_file() and not file_matches_digest(output.file, original.record.digest):
        problems.append(Problem("", "not the file that its sidecar describes", location=str(output.file)))
    try:
        with decode_known_film(output.file, output.size, len(frames)) as images:
            for _ in images:
                pass
    except InputError as error:
        problems.append(problem_of(error, str(output.file)))
        frames = ()
    return FilmFiles(problems, frames, notes)


def _has_picture(frame: FrameRecord, output: OutputSpec) -> bool:
    try:
        return Picture(file=frame_path(output.file, frame.frame)).pixels.shape == picture_shape(output)
    except HsplatError:
        return False


def verify_film(
    job: FilmJob, original: OriginalFilm, files: FilmFiles, options: RayOptions, events: JobEvents
) -> VerifiedFilm:
    """Compare a film with its inputs, and measure it. Raises InputError for a volume that is not the recorded one."""
    with open_job_stage(job, read_film_volumes(job.scene)) as stage:
        problems, notes = [*_scene_problems(job, original)], [*_tool_notes(original)]
        if notes:  # another version may have other keys, and other defaults
            notes, problems = [*notes, *(f"{each.what}: {each.got}" for each in problems)], []
        measured = None
        if job.scene.no_exact_picture is not None:
            notes.append(f"there is no exact picture to compare with: {job.scene.no_exact_picture}")
        elif files.readable:
            measured = measure_film(stage, job.scene.output, files.readable, options, events)
            problems += measured.problems
            if not measured.is_precise:
                notes.append(f"{MOST_RAYS} rays a frame, the most there are, do not reach {options.precision_db:g} dB")
    return VerifiedFilm(problems, notes, measured)


def _scene_problems(job: FilmJob, original: OriginalFilm) -> Iterator[Problem]:
    """Yield a problem where the scene is not the one whose fingerprint was recorded."""
    recorded, record = original.record.fingerprint, original.record
    if recorded is None:
        return
    now = film_fingerprint(job.scene, job.requested, record.volume.fingerprint, record.device)
    before, after = ({key: each.depends_on.get(key) for key in ("scene", "volume")} for each in (recorded, now))
    if before != after or data_digest(recorded.depends_on) != recorded.frames_digest:
        got = describe_mismatch(before, after)
        yield Problem("", "its scene is not the one that was drawn", got, location=str(original.path))


def _tool_notes(original: OriginalFilm) -> Iterator[str]:
    changed = changed_tools(original, package_versions() | {"sources": sources_digest()})
    if changed:
        yield f"drawn by other versions than these: {'; '.join(changed)}"
