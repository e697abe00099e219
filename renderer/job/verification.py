"""Verify a finished film by its files and its sidecar alone: whether it is whole, of which inputs, and how exact."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from renderer.errors import HsplatError, InputError, Problem
from renderer.film import Picture, data_digest, decode_known_film, file_matches_digest, frame_path
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
    record, notes = original.record, list[str]()
    digests = [record.digest, *(each.digest for each in record.outputs)]
    found = [[*_file_problems(original, *pair)] for pair in zip(output.files, digests, strict=False)]
    (first, *_), readable = found, record.frames
    in_files = [each for each in output.files if each.is_frames]
    num_unknown = sum(any(frame.digest_of(each.kind) is None for each in in_files) for frame in record.frames)
    if num_unknown:
        notes.append(f"{counted(num_unknown, 'frame')} of unknown digest may have been changed")
    if output.is_frames:
        readable = tuple(frame for frame in readable if _has_picture(frame, output))
        num_lost = len(record.frames) - len(readable)
        if num_lost and not first:
            first.append(Problem("", f"{counted(num_lost, 'frame')} cannot be decoded", location=str(output.file)))
    else:
        if record.digest is None:
            notes.append("the digest of the film is not recorded: the file may have been changed")
        readable = readable if all(problem.what == _CHANGED for problem in first) else ()
    if len(digests) != len(output.files):
        found.append([Problem("outputs", "not those of its scene", location=str(original.path))])
    return FilmFiles([*chain(*found)], readable, notes)


def _file_problems(original: OriginalFilm, output: OutputFile, digest: str | None) -> Iterator[Problem]:
    """Yield what is wrong with the files of an output. digest: that of a film; None for one that is not known."""
    where, part = str(output.file), Part(original.path, original.record, output.file)
    frames = [frame for frame in part.record.frames if output.shows(frame.frame)]
    if not frames:  # it shows others
        return
    if output.is_frames:
        known = [replace(frame, digest=frame.digest_of(output.kind)) for frame in frames]
        picked = [PickedFrame(each.frame, part, each) for each in known if each.digest is not None]
        yield from file_problems(picked, output.kind)
        return
    if digest is not None and output.file.is_file() and not file_matches_digest(output.file, digest):
        yield Problem("", _CHANGED, location=where)
    try:
        with decode_known_film(output, len(frames)) as images:
            for _ in images:
                pass
    except InputError as error:
        yield problem_of(error, where)


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
        changed = changed_tools(original, package_versions() | {"sources": sources_digest()})
        notes = [f"drawn by other versions than these: {'; '.join(changed)}"] * bool(changed)
        problems = [*_scene_problems(job, original)]
        if notes:  # another version may have other keys, and other defaults
            notes, problems = [*notes, *(f"{each.what}: {each.got}" for each in problems)], []
        measured = None
        if job.scene.at(0).annotation.octree:
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
