"""Accept pictures of a report as goldens: nothing is drawn, and all that they were compared with must be unchanged."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from hsplat_cli.compare.ci_files import change_text
from hsplat_cli.compare.golden.drawing import load_golden_job, origin_of_scene
from hsplat_cli.compare.golden.golden_folder import Content
from hsplat_cli.compare.golden.project import GoldenProject, GoldenScene
from hsplat_cli.compare.golden.record import (
    GoldenPicture,
    GoldenRecord,
    Origin,
    golden_file_name,
    picture_digest,
)
from hsplat_cli.compare.golden.update import GoldenUpdate, compact, keeps_files, require_person, with_picture
from hsplat_cli.compare.golden.value_text import changed_value
from hsplat_cli.compare.outcome import Change, ComparedFilm, ComparedFrame, ReportPicture
from hsplat_cli.compare.picture_file import decode_picture
from hsplat_cli.compare.report_source import ReportSource, read_report, read_report_picture
from hsplat_cli.scenes import SceneRequest
from renderer.errors import InputError
from renderer.job import FilmJob
from renderer.scene import MAX_FRAMES, counted, did_you_mean, first_few

# The remedy where a film has none of the frames of its goldens any more.
_HINT_FOR_REMOVALS = "`hsplat golden --update --prune` draws the film's own frames, and removes the others"
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
    if not (film or runs):
        raise InputError("an empty name", where="--only", got=repr(text), expected="SCENE, or SCENE:12-18,40")
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


def plan_acceptance(
    sources: Sequence[ReportSource], project: GoldenProject, only: Sequence[Decision], *, also: bool = False
) -> list[GoldenUpdate]:
    """Plan the changes that make pictures of reports the goldens of a project's scenes.

    The reports must stay open until the plan has been carried out.

    only: the films, or frames of them, that are accepted; all that fail if it is empty. also: whether the pictures
    become further goldens beside those that they were compared with.
    Raises InputError if a scene, its volume or its goldens are not those that were compared, if a report was edited,
    if there is nothing to accept, or if the job compares. Frames that were accepted before are left out.
    """
    require_person("--accept")
    reported = [(source, film) for source in sources for film in read_report(source).films]
    where = f"{sources[0].path} and {len(sources) - 1} more" if len(sources) > 1 else str(sources[0].path)
    failing = dict[str, tuple[ReportSource, ComparedFilm]]()
    for source, film in reported:
        if film.verdict == "fails" and failing.setdefault(film.name, (source, film))[1] is not film:
            got = f"{film.name}, in {failing[film.name][0].path} and {source.path}"
            raise InputError("two films that fail have one name", where=where, got=got, hint="accept one report")
    decisions = _by_film(only) if only else dict.fromkeys(failing)
    if not decisions:
        raise _nothing_fails([film for _, film in reported], where)
    scenes = {scene.name: scene for scene in project.scenes}
    updates = []
    for name, frames in decisions.items():
        if name not in failing:
            verdicts = [film.summary for _, film in reported if film.name == name]
            hint = None if verdicts else did_you_mean(name, failing)
            got, expected = ": ".join([name, *verdicts[:1]]), first_few([*failing])
            raise InputError("no such film fails in this report", where=where, got=got, expected=expected, hint=hint)
        if name not in scenes:
            raise InputError(
                "the project has no such scene",
                where=where,
                got=name,
                expected=first_few([*scenes]),
                hint="name the same scenes, or folders, as for `hsplat compare`",
            )
        source, film = failing[name]
        update = _ReportedFilm(source, film, scenes[name]).plan(frames, also=also)
        if update is not None:
            updates.append(update)
    return updates


def _nothing_fails(films: Sequence[ComparedFilm], where: str) -> InputError:
    """Return the error of a report without a film that fails: its films pass, or they could not be compared."""
    errors = [f"{film.name}: {film.summary}" for film in films if film.verdict == "not compared"]
    if not errors:
        return InputError("nothing fails in this report", where=where)
    return InputError(
        f"nothing can be accepted: {counted(len(errors), 'film')} could not be compared",
        where=where,
        got=first_few(errors, between="; "),
        hint="mend that, and compare again; `hsplat golden` draws the first goldens of a scene",
    )


def _by_film(decisions: Sequence[Decision]) -> dict[str, frozenset[int] | None]:
    """Return the accepted frames of each film; None for all that fail. Decisions on one film are joined."""
    found = dict[str, frozenset[int] | None]()
    for decision in decisions:
        before = found.get(decision.film, frozenset())
        found[decision.film] = None if before is None or decision.frames is None else before | decision.frames
    return found


@dataclass(frozen=True)
class _ReportedFilm:
    """A film of a report whose pictures become golden, and its scene."""

    source: ReportSource
    film: ComparedFilm
    scene: GoldenScene

    def plan(self, numbers: frozenset[int] | None, *, also: bool) -> GoldenUpdate | None:
        """Return the change that makes frames golden; None if they all are. numbers: None for all that fail."""
        folder = self.scene.folder
        folder.finish()
        before = folder.find()
        failing = self._failing(numbers)
        frames = [frame for frame in failing if before is None or not self._is_accepted(before, frame)]
        if not frames:
            return None  # accepted before, perhaps by a command that was killed afterwards
        if before is None or not all(self._has_same_golden(before, frame) for frame in frames):
            raise InputError(
                "these goldens have changed since they were compared",
                where=str(folder.path),
                hint="compare again, and accept from the new report",
            )
        if self.film.origin is None:
            raise InputError("this report does not say what drew the pictures", where=self._where)
        job = load_golden_job(SceneRequest(self.scene.file))
        _require_same_inputs(self.film.origin, job, self.scene.file)
        origins = [*before.origins]
        if self.film.origin not in origins:
            origins.append(self.film.origin)
        goldens, contents = {golden.frame: golden for golden in before.frames}, dict[str, Content]()
        for frame in frames:
            assert frame.frame is not None
            if frame.new is None:
                self._require_gone(frame.frame, job)
                del goldens[frame.frame]
                continue
            self._require_of_job(frame.frame, frame.new, job)
            picture = GoldenPicture(frame.new.digest, origins.index(self.film.origin), None, frame.new.psnr)
            golden = with_picture(frame.frame, before.of_frame(frame.frame), picture, also=also)
            if keeps_files(self.scene.rules, before):
                name = golden_file_name(frame.frame, job.scene.num_frames, golden.free_number)
                golden = replace(golden, pictures=(*golden.pictures[:-1], replace(picture, file=name)))
                contents[name] = partial(self._content, frame.new)
            goldens[frame.frame] = golden
        if not goldens:
            raise InputError("no golden of this film would be left", where=self._where, hint=_HINT_FOR_REMOVALS)
        folder.require_changeable([*contents, *before.files], job.input_files())
        after = compact(
            GoldenRecord(tuple(origins), tuple(goldens[number] for number in sorted(goldens)), before.selection)
        )
        after = replace(after, flicker=self._flicker(before, after))
        return GoldenUpdate(folder, before, after, contents, [_line(self.film.name, frames)], asks=False)

    @property
    def _where(self) -> str:
        return f"{self.source.path}: {self.film.name}"

    def _failing(self, numbers: frozenset[int] | None) -> list[ComparedFrame]:
        """Return the frames that are accepted. Raises InputError if the report has no pictures of them."""
        numbered = [(frame.frame, frame) for frame in self.film.failing if frame.frame is not None]
        failing = dict(numbered)
        if len(failing) < len(numbered):
            raise InputError("two frames of this report have one number", where=self._where)
        wanted = sorted(failing if numbers is None else numbers)
        unknown = [number for number in wanted if number not in failing]
        if unknown:
            raise InputError(
                "these frames do not fail in this report",
                where=self._where,
                got=first_few(unknown),
                expected=first_few(sorted(failing)),
            )
        frames = [failing[number] for number in wanted]
        missing = [frame.name for frame in frames if not frame.is_gone and (frame.new is None or not frame.new.file)]
        if missing:
            raise InputError("no new picture in this report", where=self._where, got=first_few(missing))
        return frames

    def _is_accepted(self, record: GoldenRecord, frame: ComparedFrame) -> bool:
        """Return whether the new picture of a frame is golden already, or the golden of a lost frame removed."""
        golden = None if frame.frame is None else record.of_frame(frame.frame)
        if frame.is_gone:
            return golden is None
        if golden is None or frame.new is None:
            return False
        return any(each.digest == frame.new.digest and self.scene.folder.holds(each) for each in golden.pictures)

    def _has_same_golden(self, record: GoldenRecord, frame: ComparedFrame) -> bool:
        """Return whether the golden that a frame was compared with is still one of its goldens."""
        golden = None if frame.frame is None else record.of_frame(frame.frame)
        if golden is None or frame.old is None:
            return golden is None and frame.old is None
        return any(self.scene.folder.shown_digest(each) == frame.old.digest for each in golden.pictures)

    def _flicker(self, before: GoldenRecord, after: GoldenRecord) -> float | None:
        """Return the flicker of the new goldens; None unless they are the pictures of the film that was drawn."""
        if after.frames == before.frames:
            return before.flicker
        drawn = {frame.frame: frame.new.digest for frame in self.film.frames if frame.new is not None}
        is_whole = {golden.frame: golden.pictures[0].digest for golden in after.frames} == drawn
        return self.film.flicker.new if is_whole and self.film.flicker else None

    def _require_gone(self, number: int, job: FilmJob) -> None:
        """Raise InputError if a scene has a frame that the report says it has not."""
        if number in frozenset(job.frames):
            raise InputError(
                "the scene has this frame", where=self._where, got=f"frame {number}, without a new picture"
            )

    def _require_of_job(self, number: int, new: ReportPicture, job: FilmJob) -> None:
        """Raise InputError unless a new picture is one that the report describes, and that the scene can have."""
        if number not in frozenset(job.frames):
            raise InputError("the scene has no such frame", where=self._where, got=f"frame {number}")
        height, width, _ = decode_picture(self._content(new), self.source.path / new.file).shape
        if (width, height) != job.scene.output.size:
            raise InputError(
                "a picture of another size than the scene's",
                where=f"{self.source.path}: {new.file}",
                got=f"{width} x {height} pixels",
                expected="{} x {} pixels".format(*job.scene.output.size),
            )

    def _content(self, new: ReportPicture) -> bytes:
        """Return the content of the file of a new picture. Raises InputError if it is not what the report describes."""
        content = read_report_picture(self.source, new.file)
        if picture_digest(decode_picture(content, self.source.path / new.file)) != new.digest:
            where = f"{self.source.path}: {new.file}"
            raise InputError("this picture is not the one that the report describes", where=where)
        return content


def _line(name: str, frames: Sequence[ComparedFrame]) -> str:
    """Return a line on accepted frames: `engine: 3 frames accepted, 1 golden removed`."""
    num_gone = sum(frame.is_gone for frame in frames)
    parts = [f"{counted(len(frames) - num_gone, 'frame')} accepted"] if num_gone < len(frames) else []
    parts += [f"{counted(num_gone, 'golden')} removed"] if num_gone else []
    return f"{name}: {', '.join(parts)}"


def _in_words(path: str, was: Any, now: Any) -> str:
    return change_text(Change(*changed_value(path.removeprefix("scene."), was, now)))


def _require_same_inputs(drawn: Origin, job: FilmJob, file: Path) -> None:
    """Raise InputError unless a scene and its voxels are those that pictures were drawn from."""
    changes = drawn.changes(origin_of_scene(job))
    if changes:
        raise InputError(
            "the scene, or its volume, changed since the pictures were drawn",
            where=str(file),
            got=first_few([_in_words(*change) for change in changes], between="; "),
            hint="compare again, and accept from the new report",
        )
