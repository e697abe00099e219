"""Verify a finished film by its files and its sidecar alone: whether it is whole, of which inputs, and how exact."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import zip_longest

from renderer.errors import HsplatError, InputError, Problem
from renderer.film import (
    Picture,
    data_digest,
    decode_known_film,
    file_matches_digest,
    frame_matches_digest,
    frame_path,
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
from renderer.scene import OutputFile, OutputSpec, counted
from renderer.system import package_versions, sources_digest

_CHANGED = "not the file that its sidecar describes"


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
    found = _verify_first(original, output)
    problems = [*found.problems]
    for each, record in zip_longest(output.others, original.record.outputs):
        if each is None or record is None:
            problems.append(Problem("outputs", "not those of its scene", location=str(original.path)))
            break
        problems += _other_problems(original, each, record.digest)
    return replace(found, problems=problems)


def _other_problems(original: OriginalFilm, output: OutputFile, digest: str | None) -> Iterator[Problem]:
    """Yield what is wrong with the files of a further output. digest: that of a film."""
    frames = [frame for frame in original.record.frames if output.shows(frame.frame)]
    if not output.is_frames and frames:
        yield from _film_problems(output, digest, len(frames))
        return
    for frame in frames:
        file = frame_path(output.file, frame.frame)
        if not frame_matches_digest(file, frame.digest_of(output.kind), output.kind):
            yield Problem("", f"not the picture of frame {frame.frame} that was recorded", location=str(file))


def _film_problems(output: OutputFile, digest: str | None, num_frames: int) -> Iterator[Problem]:
    """Yield what is wrong with a film in one file. digest: None for one that is not known."""
    where = str(output.file)
    if digest is not None and output.file.is_file() and not file_matches_digest(output.file, digest):
        yield Problem("", _CHANGED, location=where)
    try:
        with decode_known_film(output, num_frames) as images:
            for _ in images:
                pass
    except InputError as error:
        yield problem_of(error, where)


def _verify_first(original: OriginalFilm, output: OutputSpec) -> FilmFiles:
    frames, notes = original.record.frames, list[str]()
    if output.is_frames:
        known = [frame for frame in frames if frame.digest is not None]
        if len(known) < len(frames):
            notes.append(f"{counted(len(frames) - len(known), 'frame')} of unknown digest may have been changed")
        part = Part(original.path, original.record, output.file)
        problems = [*file_problems([PickedFrame(each.frame, part, each) for each in known], output.kind)]
        readable = [frame for frame in frames if _has_picture(frame, output)]
        if len(readable) < len(frames) and not problems:
            what = f"{counted(len(frames) - len(readable), 'frame')} cannot be decoded"
            problems.append(Problem("", what, location=str(output.file)))
        return FilmFiles(problems, readable, notes)
    if original.record.digest is None:
        notes.append("the digest of the film is not recorded: the file may have been changed")
    problems = [*_film_problems(output, original.record.digest, len(frames))]
    is_whole = all(problem.what == _CHANGED for problem in problems)
    return FilmFiles(problems, frames if is_whole else (), notes)


def _has_picture(frame: FrameRecord, output: OutputSpec) -> bool:
    try:
        return bool(Picture(file=frame_path(output.file, frame.frame)).pixels.shape == output.kind.shape)
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
        if job.scene.annotation.octree:
            notes.append("the lines along cells cover the pictures, which are not measured")
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
