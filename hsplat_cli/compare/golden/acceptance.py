"""Accept pictures of a report as goldens: nothing is drawn, and all that they were compared with must be unchanged."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from hsplat_cli.compare.golden.changes import input_changes
from hsplat_cli.compare.golden.drawing import load_golden_job, origin_of_scene
from hsplat_cli.compare.golden.merging import GoldenMerger
from hsplat_cli.compare.golden.project import GoldenProject, GoldenScene
from hsplat_cli.compare.golden.record import Golden, GoldenRecord, Origin, picture_digest
from hsplat_cli.compare.golden.update import GoldenUpdate, require_person
from hsplat_cli.compare.outcome import ComparedFilm, ComparedFrame, ReportPicture
from hsplat_cli.compare.picture_file import decode_picture
from hsplat_cli.compare.report_source import ReportSource, read_report, read_report_picture
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter
from renderer.errors import InputError
from renderer.job import FilmJob
from renderer.scene import MAX_FRAMES, counted, did_you_mean, first_few

# The remedy where a film has none of the frames of its goldens any more.
_HINT_FOR_REMOVALS = "`hsplat golden --update --prune` draws the film's own frames, and removes the others"
# A run of frames in `--only`: `7`, or `12-18`.
_RUN = re.compile(r"([0-9]{1,9})(?:-([0-9]{1,9}))?")


def parse_decisions(texts: Iterable[str]) -> dict[str, frozenset[int] | None]:
    """Return the frames of each film that values of `--only` spell: `engine`, or `scenes/engine:12-18,40`.

    A film alone has None, for all its frames that fail. Values for one film are joined.
    """
    found = dict[str, frozenset[int] | None]()
    for text in texts:
        film, colon, runs = text.rpartition(":")
        if not (film or runs):
            raise InputError("an empty name", where="--only", got=repr(text), expected="SCENE, or SCENE:12-18,40")
        if not colon:
            found[text] = None
            continue
        frames = frozenset(frame for run in runs.split(",") for frame in _run(run, text))
        before = found.get(film, frozenset())
        found[film] = None if before is None else before | frames
    return found


def _run(run: str, text: str) -> range:
    """Return a run of frames, `7` or `12-18`. text: the whole value, for the message."""
    found = _RUN.fullmatch(run.strip())
    first = int(found[1]) if found else -1
    last = int(found[2]) if found and found[2] else first
    if not 0 <= first <= last < MAX_FRAMES:
        raise InputError("not frames of a film", where="--only", got=text, expected="SCENE:12-18,40")
    return range(first, last + 1)


def plan_acceptance(
    sources: Sequence[ReportSource],
    project: GoldenProject,
    only: Mapping[str, frozenset[int] | None],
    reporter: Reporter,
    *,
    also: bool = False,
) -> list[GoldenUpdate]:
    """Plan the changes that make pictures of reports the goldens of a project's scenes.

    The reports must stay open until the plan has been carried out.

    only: the films that are accepted, by name, and their frames, as `parse_decisions` returns them; all that fail if
    it is empty; films that could not be compared are then noted. also: whether the pictures become further goldens
    beside those that they were compared with.
    Raises InputError if a scene, its volume or its goldens are not those that were compared, if a report was edited,
    if there is nothing to accept, or if the job compares. Frames that were accepted before are left out.
    """
    require_person("--accept")
    reported = [(source, film) for source in sources for film in read_report(source).films]
    where = f"{sources[0].path} and {len(sources) - 1} more" if len(sources) > 1 else str(sources[0].path)
    failing = dict[str, tuple[ReportSource, ComparedFilm]]()
    for source, film in reported:
        if film.verdict == "fails" and film.scene and failing.setdefault(film.name, (source, film))[1] is not film:
            got = f"{film.name}, in {failing[film.name][0].path} and {source.path}"
            raise InputError("two films that fail have one name", where=where, got=got, hint="accept one report")
    decisions = only or dict.fromkeys(failing)
    if not decisions:
        raise _nothing_fails([film for _, film in reported], where)
    left_out = [film.name for _, film in reported if film.verdict == "not compared" and not only]
    if left_out:
        first = "`hsplat golden` draws the first goldens of a scene"
        reporter.note(f"left out, as they could not be compared: {first_few(left_out)}; {first}")
    scenes = {scene.name: scene for scene in project.scenes}
    updates = []
    for name, frames in decisions.items():
        if name not in failing:
            raise _not_failing(name, [film for _, film in reported], [*failing], where)
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


def _not_failing(name: str, films: Sequence[ComparedFilm], failing: Sequence[str], where: str) -> InputError:
    """Return the error of a film that `--only` names, and that does not fail. failing: the names of films that do."""
    verdicts = [film.summary for film in films if film.name == name]
    got, expected = ": ".join([name, *verdicts[:1]]), first_few(failing)
    hint = None if verdicts else did_you_mean(name, failing)
    if "," in name and not verdicts:
        hint = "repeat --only for each film: --only A --only B"
    return InputError("no such film fails in this report", where=where, got=got, expected=expected, hint=hint)


def _nothing_fails(films: Sequence[ComparedFilm], where: str) -> InputError:
    """Return the error of a report without a film that fails: its films pass, or they could not be compared."""
    errors = [f"{film.name}: {film.summary}" for film in films if film.verdict == "not compared"]
    if not errors:
        return InputError("no film of a scene fails in this report", where=where)
    return InputError(
        f"nothing can be accepted: {counted(len(errors), 'film')} could not be compared",
        where=where,
        got=first_few(errors, between="; "),
        hint="mend that, and compare again; `hsplat golden` draws the first goldens of a scene",
    )


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
        goldens = before.by_frame if before else {}
        failing = self._failing(numbers).items()
        frames = {number: frame for number, frame in failing if not self._is_accepted(goldens.get(number), frame)}
        if before is not None and not frames:
            self._load_job()
            return None  # accepted before, perhaps by a command that was killed afterwards
        if before is None or not all(self._has_same_golden(goldens.get(each), frames[each]) for each in frames):
            raise InputError(
                "these goldens have changed since they were compared",
                where=str(folder.path),
                hint="compare again, and accept from the new report",
            )
        job, origin = self._load_job()
        self._require_frames(frames, frozenset(job.frames))
        merger = GoldenMerger(self.scene, before, origin, job.scene.num_frames, also=also)
        for number, frame in frames.items():
            if frame.new is None:
                del merger.goldens[number]
                continue
            content = partial(self._content, frame.new, job.scene.output.size)
            content()  # found before anything is written
            merger.merge(number, frame.new.digest, frame.new.psnr, content)
        if not merger.goldens:
            raise InputError("no golden of this film would be left", where=self._where, hint=_HINT_FOR_REMOVALS)
        folder.require_changeable([*merger.contents, *before.files], job.input_files())
        after = merger.record(before.selection, before.flicker)
        if after.frames != before.frames:
            after = replace(after, flicker=self._flicker(after))
        return GoldenUpdate(
            folder, before, after, merger.contents, [_line(self.film.name, frames.values())], asks=False
        )

    @property
    def _where(self) -> str:
        return f"{self.source.path}: {self.film.name}"

    def _load_job(self) -> tuple[FilmJob, Origin]:
        """Return the job of the scene, and the origin of the report's pictures.

        Raises InputError unless they are of the same scene and voxels.
        """
        if self.film.origin is None:
            raise InputError("this report does not say what drew the pictures", where=self._where)
        job = load_golden_job(SceneRequest(self.scene.file))
        _require_same_inputs(self.film.origin, job, self.scene.file)
        return job, self.film.origin

    def _failing(self, numbers: frozenset[int] | None) -> dict[int, ComparedFrame]:
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
        frames = {number: failing[number] for number in wanted}
        missing = [each.name for each in frames.values() if not (each.is_gone or (each.new and each.new.file))]
        if missing:
            raise InputError("no new picture in this report", where=self._where, got=first_few(missing))
        return frames

    def _is_accepted(self, golden: Golden | None, frame: ComparedFrame) -> bool:
        """Return whether the new picture of a frame is golden already, or the golden of a lost frame removed."""
        if golden is None or frame.new is None:
            return golden is None and frame.is_gone
        return any(each.digest == frame.new.digest and self.scene.folder.holds(each) for each in golden.pictures)

    def _has_same_golden(self, golden: Golden | None, frame: ComparedFrame) -> bool:
        """Return whether the golden that a frame was compared with is still one of its goldens."""
        if golden is None or frame.old is None:
            return golden is None and frame.old is None
        return any(self.scene.folder.shown_digest(each) == frame.old.digest for each in golden.pictures)

    def _flicker(self, after: GoldenRecord) -> float | None:
        """Return the flicker of new goldens; None unless they are the pictures of the film that was drawn."""
        drawn = {frame.frame: frame.new.digest for frame in self.film.frames if frame.new is not None}
        is_whole = {golden.frame: golden.pictures[0].digest for golden in after.frames} == drawn
        return self.film.flicker.new if is_whole and self.film.flicker else None

    def _require_frames(self, frames: Mapping[int, ComparedFrame], there: frozenset[int]) -> None:
        """Raise InputError unless the report has new pictures of frames of the scene alone. there: these frames."""
        for number, frame in frames.items():
            if (number in there) == frame.is_gone:
                what = "the scene has this frame" if frame.is_gone else "the scene has no such frame"
                with_picture = "without a new picture" if frame.is_gone else "with a new picture"
                raise InputError(what, where=self._where, got=f"frame {number}, {with_picture}")

    def _content(self, new: ReportPicture, size: tuple[int, int]) -> bytes:
        """Return the content of the file of a new picture.

        Raises InputError if it is not what the report describes, or has not the size of the scene.
        """
        content, path = read_report_picture(self.source, new.file), self.source.path / new.file
        picture = decode_picture(content, path)
        if picture_digest(picture) != new.digest:
            raise InputError("this picture is not the one that the report describes", where=str(path))
        height, width, _ = picture.shape
        if (width, height) != size:
            raise InputError(
                "a picture of another size than the scene's",
                where=str(path),
                got=f"{width} x {height} pixels",
                expected="{} x {} pixels".format(*size),
            )
        return content


def _line(name: str, frames: Collection[ComparedFrame]) -> str:
    """Return a line on accepted frames: `engine: 3 frames accepted, 1 golden removed`."""
    num_gone = sum(frame.is_gone for frame in frames)
    parts = [f"{counted(len(frames) - num_gone, 'frame')} accepted"] if num_gone < len(frames) else []
    parts += [f"{counted(num_gone, 'golden')} removed"] if num_gone else []
    return f"{name}: {', '.join(parts)}"


def _require_same_inputs(drawn: Origin, job: FilmJob, file: Path) -> None:
    """Raise InputError unless a scene and its voxels are those that pictures were drawn from."""
    changes = [change.words for change in input_changes(drawn, origin_of_scene(job), {})]
    if changes:
        raise InputError(
            "the scene, or its volume, changed since the pictures were drawn",
            where=str(file),
            got=first_few(changes, between="; "),
            hint="compare again, and accept from the new report",
        )
