"""Verify a finished film: whether its files are whole, whether it shows its scene and volume, and how exact it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from renderer.errors import HsplatError, InputError, Problem
from renderer.film import Picture, data_digest, decode_known_film, file_matches_digest, frame_path
from renderer.frame import FilmStage
from renderer.record.film_record import FrameRecord
from renderer.record.fingerprint import film_fingerprint
from renderer.record.finished_film import FinishedFilm
from renderer.record.picture_files import FrameFile, picture_problems
from renderer.record.record_making import changed_tools
from renderer.record.up_to_date import describe_mismatch
from renderer.record.verified_accuracy import FreshAccuracy, RayOptions, RayProgress, measure_pictures, most_rays
from renderer.scene import ErrorSpec, FilmScene, OutputFile, OutputSpec, accuracy_of, counted

# The message about a file whose digest is not the recorded one. The pictures in the file can be measured all the same.
_CHANGED = "not the file that its sidecar describes"


@dataclass(frozen=True)
class FilesCheck:
    """A check of the files of a film, by their digests and by decoding them.

    problems: differences from the sidecar. readable: the frames whose pictures can be decoded. notes: sentences on
    files whose digests are not recorded.
    """

    problems: Sequence[Problem]
    readable: Sequence[FrameRecord]
    notes: Sequence[str]


@dataclass(frozen=True)
class PicturesCheck:
    """A check of the pictures of a film against its scene and volume.

    problems: differences from the scene and the recorded accuracy. notes: sentences on what cannot be checked.
    measured: the accuracy by exact rays; None if no picture was measured.
    """

    problems: Sequence[Problem]
    notes: Sequence[str]
    measured: FreshAccuracy | None


def verify_files(film: FinishedFilm, output: OutputSpec) -> FilesCheck:
    """Check all files of a film, in the folder where it is now, and decode them.

    Raises RenderError if ffmpeg is missing.
    """
    record, notes = film.record, list[str]()
    digests = [record.digest, *(each.digest for each in record.outputs)]
    found = [[*_file_problems(film, *pair)] for pair in zip(output.files, digests, strict=False)]
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
        found.append([Problem("outputs", "not those of its scene", location=str(film.path))])
    return FilesCheck([*chain(*found)], readable, notes)


def _file_problems(film: FinishedFilm, output: OutputFile, digest: str | None) -> Iterator[Problem]:
    """Yield the problems of the files of an output.

    digest: the recorded digest of an output in one file; None if it is not recorded.
    """
    where = str(output.file)
    frames = [frame for frame in film.record.frames if output.shows(frame.frame)]
    if not frames:  # none of the frames that the output shows were drawn
        return
    if output.is_frames:
        known = [replace(frame, digest=frame.digest_of(output.kind)) for frame in frames]
        files = [
            FrameFile(film, each, frame_path(output.file, each.frame)) for each in known if each.digest is not None
        ]
        yield from picture_problems(files, output.kind)
        return
    if digest is not None and output.file.is_file() and not file_matches_digest(output.file, digest):
        yield Problem("", _CHANGED, location=where)
    try:
        with decode_known_film(output, len(frames)) as images:
            for _ in images:
                pass
    except InputError as error:
        yield error.problem_at(where)


def _has_picture(frame: FrameRecord, output: OutputSpec) -> bool:
    try:
        return bool(Picture(file=frame_path(output.file, frame.frame)).pixels.shape == output.kind.shape)
    except HsplatError:
        return False


def verify_pictures(
    film: FinishedFilm, stage: FilmStage, files: FilesCheck, options: RayOptions, progress: RayProgress
) -> PicturesCheck:
    """Compare a film with its scene, and measure its pictures.

    stage: the stage of the film's scene and volume. files: the check of the film's files.
    """
    scene, notes = stage.scene, list[str]()
    # If somebody has edited the scene, other tolerances and other versions of packages are no problems.
    is_unchanged = film.has_tolerances_of(scene)
    requested = film.record.schedule.requested if is_unchanged else accuracy_of(scene.error)
    changed = changed_tools(film) if is_unchanged else []
    problems = [*_scene_problems(film, scene, requested)]
    if changed:  # in other versions, scenes may have other keys and other defaults
        notes = [f"drawn by other versions than these: {'; '.join(changed)}"]
        notes += [f"{each.what}: {each.got}" for each in problems]
        problems = []
    measured = None
    if scene.at(0).annotation.octree:
        notes.append("the lines along cells cover the pictures, which are not measured")
    elif files.readable:
        measured = measure_pictures(stage, files.readable, options, progress)
        problems += measured.problems
        if not measured.is_precise:
            most = most_rays(stage.scene.output)
            probes = "rays" if scene.at(0).light is None else "pixels by paths"
            notes.append(f"{most} {probes} a frame, the most there are, do not reach {options.precision_db:g} dB")
    return PicturesCheck(problems, notes, measured)


def _scene_problems(film: FinishedFilm, scene: FilmScene, requested: ErrorSpec) -> Iterator[Problem]:
    """Yield a problem if the scene is not the one whose fingerprint was recorded.

    requested: the accuracy that was requested of the film, which is part of the fingerprint.
    """
    recorded, record = film.record.fingerprint, film.record
    if recorded is None:
        return
    now = film_fingerprint(scene, requested, record.volume.fingerprint, record.device)
    before, after = ({key: each.depends_on.get(key) for key in ("scene", "volume")} for each in (recorded, now))
    if before != after or data_digest(recorded.depends_on) != recorded.frames_digest:
        got = describe_mismatch(before, after)
        yield Problem("", "its scene is not the one that was drawn", got, location=str(film.path))
