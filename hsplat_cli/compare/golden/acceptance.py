"""Accept pictures of a report as goldens: nothing is drawn, and all that they were compared with must be unchanged."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hsplat_cli.compare.golden.drawing import load_golden_job, origin_of_scene
from hsplat_cli.compare.golden.project import GoldenProject, GoldenScene
from hsplat_cli.compare.golden.record import (
    Golden,
    GoldenPicture,
    GoldenRecord,
    Origin,
    golden_file_name,
    picture_digest,
)
from hsplat_cli.compare.golden.update import GoldenUpdate, compact
from hsplat_cli.compare.outcome import ComparedFilm, ComparedFrame
from hsplat_cli.compare.picture_file import decode_picture
from hsplat_cli.compare.report_source import ReportSource, read_report, read_report_picture
from hsplat_cli.scenes import SceneRequest
from renderer.errors import InputError
from renderer.job import FilmJob
from renderer.scene import MAX_FRAMES, counted, did_you_mean, first_few

# A run of frames in `--only`: `7`, or `12-18`.
_RUN = re.compile(r"([0-9]{1,9})(?:-([0-9]{1,9}))?")


@dataclass(frozen=True)
class Decision:
    """A decision to accept frames of a film. film: its name. frames: their numbers; None for all that fail."""

    film: str
    frames: frozenset[int] | None = None


def parse_decision(text: str) -> Decision:
    """Return the decision that a value of `--only` spells: `engine`, or `scenes/engine:12-18,40`."""
    film, colon, runs = text.rpartition(":")
    if not colon:
        return Decision(text)
    frames = set[int]()
    for run in runs.split(","):
        found = _RUN.fullmatch(run.strip())
        first = int(found[1]) if found else -1
        last = int(found[2]) if found and found[2] else first
        if not 0 <= first <= last < MAX_FRAMES:
            raise InputError("not frames of a film", where="--only", got=text, expected="SCENE:12-18,40")
        frames.update(range(first, last + 1))
    return Decision(film, frozenset(frames))


def plan_acceptance(source: ReportSource, project: GoldenProject, only: Sequence[Decision]) -> list[GoldenUpdate]:
    """Plan the changes that make pictures of a report the goldens of a project's scenes.

    only: the films, or frames of them, that are accepted; all that fail if it is empty.
    Raises InputError if a scene, its volume or its goldens are not those that were compared, if the report was edited,
    or if it has nothing to accept. Films that were accepted before are left out.
    """
    report = read_report(source)
    films = {film.name: film for film in report.films if film.verdict == "fails"}
    decisions = {decision.film: decision for decision in only} or {name: Decision(name) for name in films}
    for name in decisions:
        if name not in films:
            hint = did_you_mean(name, films)
            raise InputError("no such film fails in this report", where=str(source.path), got=name, hint=hint)
    if not decisions:
        raise InputError("nothing fails in this report", where=str(source.path))
    scenes = {scene.name: scene for scene in project.scenes}
    updates = []
    for name, decision in decisions.items():
        if name not in scenes:
            raise InputError("the project has no such scene", where=str(source.path), got=name)
        update = _plan_film(source, films[name], scenes[name], decision)
        if update is not None:
            updates.append(update)
    return updates


def _plan_film(source: ReportSource, film: ComparedFilm, scene: GoldenScene, decision: Decision) -> GoldenUpdate | None:
    frames = _accepted(film, decision, source.path)
    folder, before = scene.folder, scene.folder.find()
    if before is not None and _are_golden(before, frames):
        return None  # accepted before, perhaps by a command that was killed afterwards
    if before is None or folder.digest != film.golden_digest:
        raise InputError(
            "these goldens have changed since they were compared",
            where=str(folder.path),
            hint="compare again, and accept from the new report",
        )
    if film.origin is None:
        raise InputError("this report does not say what drew the pictures", where=f"{source.path}: {film.name}")
    job = load_golden_job(SceneRequest(scene.file))
    _require_same_inputs(film.origin, job, scene.file)
    contents, goldens = dict[str, bytes](), {golden.frame: golden for golden in before.frames}
    origins = [*before.origins]
    if film.origin not in origins:
        origins.append(film.origin)
    for frame in frames:
        golden, content = _golden(source, frame, origins.index(film.origin), job.scene.num_frames)
        if scene.rules.pictures == "digests":
            golden = replace(golden, pictures=tuple(replace(each, file=None) for each in golden.pictures))
        else:
            contents[golden_file_name(golden.frame, job.scene.num_frames)] = content
        goldens[golden.frame] = golden
    is_whole = len(frames) == len(before.frames)
    flicker = film.flicker.new if is_whole and film.flicker else None
    ordered = tuple(goldens[number] for number in sorted(goldens))
    record = compact(GoldenRecord(tuple(origins), ordered, flicker))
    line = f"{film.name}: {counted(len(frames), 'frame')} accepted"
    return GoldenUpdate(scene, record, contents, [line], asks=False)


def _accepted(film: ComparedFilm, decision: Decision, path: Path) -> list[ComparedFrame]:
    """Return the frames of a film that are accepted. Raises InputError if the report has no pictures of them."""
    failing = {frame.frame: frame for frame in film.failing if frame.frame is not None}
    wanted = sorted(failing) if decision.frames is None else sorted(decision.frames)
    unknown = [number for number in wanted if number not in failing]
    if unknown:
        raise InputError(
            "these frames do not fail in this report",
            where=f"{path}: {film.name}",
            got=first_few(unknown),
            expected=first_few(sorted(failing)),
        )
    frames = [failing[number] for number in wanted]
    missing = [frame.name for frame in frames if frame.new is None or not frame.new.file]
    if missing:
        raise InputError("no new picture in this report", where=f"{path}: {film.name}", got=first_few(missing))
    return frames


def _are_golden(record: GoldenRecord, frames: Sequence[ComparedFrame]) -> bool:
    """Return whether the new pictures of all frames are golden already."""

    def is_golden(frame: ComparedFrame) -> bool:
        golden = None if frame.frame is None else record.of_frame(frame.frame)
        return golden is not None and any(frame.new and each.digest == frame.new.digest for each in golden.pictures)

    return all(map(is_golden, frames))


def _golden(source: ReportSource, frame: ComparedFrame, origin: int, num_frames: int) -> tuple[Golden, bytes]:
    """Return the golden of a new picture, and the content of its file. Raises InputError if the picture was changed."""
    assert frame.new is not None and frame.frame is not None
    content = read_report_picture(source, frame.new.file)
    digest = picture_digest(decode_picture(content, source.path / frame.new.file))
    if digest != frame.new.digest:
        raise InputError(
            "this picture is not the one that the report describes", where=f"{source.path}: {frame.new.file}"
        )
    name = golden_file_name(frame.frame, num_frames)
    return Golden(frame.frame, (GoldenPicture(digest, origin, name, frame.new.psnr),)), content


def _require_same_inputs(drawn: Origin, job: FilmJob, file: Path) -> None:
    """Raise InputError unless a scene and its voxels are those that pictures were drawn from."""
    changes = drawn.changes(origin_of_scene(job))
    if changes:
        raise InputError(
            "the scene, or its volume, changed since the pictures were drawn",
            where=str(file),
            got=first_few([key.removeprefix("scene.") for key, _, _ in changes]),
            hint="compare again, and accept from the new report",
        )
