"""Draw goldens of scenes, or new ones after the user has seen the changes."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

from hsplat_cli.compare.difference import measure_difference
from hsplat_cli.compare.frame_comparison import compare_frame
from hsplat_cli.compare.golden.changes import changes_since
from hsplat_cli.compare.golden.drawing import DrawnFrames, drawn_frames, load_golden_job
from hsplat_cli.compare.golden.golden_folder import Content, GoldenFolder
from hsplat_cli.compare.golden.merging import GoldenMerger, keeps_files
from hsplat_cli.compare.golden.project import GoldenProject, GoldenScene, SceneRules
from hsplat_cli.compare.golden.record import (
    ALL_FRAMES,
    Golden,
    GoldenPicture,
    GoldenRecord,
    golden_file_name,
    picture_digest,
)
from hsplat_cli.compare.limit import HINT_FOR_DIGESTS, LIMIT_OF_DIGESTS, SAME_BYTES, Limit
from hsplat_cli.compare.outcome import MOST_CHANGES
from hsplat_cli.compare.picture_file import file_content, read_picture
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter, format_table, parse_frames
from renderer.errors import InputError
from renderer.film import Pixels
from renderer.job import FilmJob
from renderer.scene import counted, first_few

# The events by which GitHub and GitLab start a job for a change of the code.
_EVENTS_OF_CHANGES = (
    "push",
    "pull_request",
    "pull_request_target",
    "merge_group",
    "merge_request_event",
)
# The limit of scenes that OpenGL draws, whose drivers round in different ways.
_OPENGL_LIMIT = Limit("decibels", 40.0)
# The largest number of changed goldens that the terminal lists.
_MOST_LINES = 20
# The change of a golden that replaces none.
_NEW = "new"


@dataclass(frozen=True)
class GoldenOptions:
    """The options of `hsplat golden`.

    frames: a Python slice of the frames that are drawn; None without one. replaces: whether goldens that exist may be
    replaced. also: whether new pictures become further goldens beside them, for a machine that draws other ones.
    prunes: whether goldens of other frames are removed.
    """

    frames: str | None = None
    replaces: bool = False
    also: bool = False
    prunes: bool = False


@dataclass(frozen=True)
class GoldenUpdate:
    """A change of the goldens of one scene.

    before, after: the content of golden.json that the change was planned for, and the new one; `after` is None if all
    goldens are removed, as no scene has them. contents: functions that return the content of each new file. lines: the
    change, in words. asks: whether goldens are replaced or removed, so that the user has to agree.
    """

    folder: GoldenFolder
    before: GoldenRecord | None
    after: GoldenRecord | None
    contents: Mapping[str, Content]
    lines: Sequence[str]
    asks: bool

    def apply(self) -> str:
        """Write the change. Return a line on the goldens that there are now."""
        if self.after is not None:
            self.folder.change(self.before, self.after, self.contents)
            return f"{self.folder.path}: {counted(len(self.after.frames), 'golden')}"
        assert self.before is not None, "goldens are removed where there are some"
        self.folder.remove(self.before)
        return f"{self.folder.path}: removed"


def require_person(option: str) -> None:
    """Raise InputError in a job of GitHub or GitLab that a change of the code started: such jobs compare.

    People decide which pictures become golden. They start a job that changes goldens by hand. option: the option that
    asks for it.
    """
    event = os.environ.get("GITHUB_EVENT_NAME", "")
    if os.environ.get("CI_JOB_MANUAL") != "true":
        event = event or os.environ.get("CI_PIPELINE_SOURCE", "")
    if event in _EVENTS_OF_CHANGES:
        raise InputError(
            "goldens do not change in a job that a change of the code starts",
            where=option,
            got=f"a job that `{event}` started",
            expected="a job that a person starts, such as by workflow_dispatch",
        )


def scenes_to_draw(project: GoldenProject, options: GoldenOptions, reporter: Reporter) -> list[GoldenScene]:
    """Return the scenes whose goldens are drawn: without `--update` or `--also`, those that have none.

    Raises InputError if all have goldens, and none of the options says what becomes of them, or if goldens in another
    place may belong to a scene that has none.
    """
    scenes = project.scenes
    for scene in scenes:
        _require_no_former(scene, project.unused if options.prunes else ())
    if options.replaces or options.also:
        require_person("--update" if options.replaces else "--also")
        return [*scenes]
    found = [scene for scene in scenes if scene.folder.find() is None]
    if not found:
        raise InputError(
            "this scene has goldens" if len(scenes) == 1 else "all scenes have goldens",
            where=str(scenes[0].folder.path) if len(scenes) == 1 else None,
            hint="--update replaces them, --also keeps further ones for this machine",
        )
    if len(found) < len(scenes):
        reporter.note(f"{counted(len(scenes) - len(found), 'scene')} with goldens left alone: --update draws all")
    return found


def _require_no_former(scene: GoldenScene, pruned: Sequence[GoldenFolder]) -> None:
    """Raise InputError if a scene without goldens may have some in another place. pruned: those that are removed."""
    if scene.former is not None and scene.former not in pruned and scene.folder.find() is None:
        remove = shlex.join(["git", "rm", "-r", str(scene.former.path)])
        raise InputError(
            "goldens in another place may be this scene's",
            where=str(scene.file),
            got=str(scene.former.path),
            expected=str(scene.folder.path),
            hint=f"`{scene.move_command}` keeps them, `{remove}` removes them; --goldens FOLDER draws others there",
        )


def plan_update(
    scene: GoldenScene, options: GoldenOptions, reporter: Reporter, drawings: ExitStack
) -> GoldenUpdate | None:
    """Draw the frames of a scene, and plan how its goldens change; None if they do not.

    drawings: keeps the drawn files until the plan has been carried out.
    """
    scene.folder.finish()
    before = scene.folder.find()
    scene.folder.unlisted(before)
    job = load_golden_job(SceneRequest(scene.file))
    numbers = _frames(scene, options, before, job)
    names = {golden_file_name(frame, job.scene.num_frames) for frame in numbers} | (before.files if before else set())
    scene.folder.require_changeable(names, job.input_files())
    if before is not None and options.replaces and not options.prunes:
        _note_left(scene.name, before.by_frame.keys() - {*numbers}, job, reporter)
    drawing = _Drawing(
        scene, options, before, limit_of(scene, before, job), job.scene.num_frames,
        drawings.enter_context(drawn_frames(job, numbers, reporter)),
    )  # fmt: skip
    after, contents = drawing.merged(_selection(scene, options, before, job, numbers))
    if before is not None and replace(after, flicker=before.flicker) == before and not contents:
        return None
    rows = [*drawing.rows(after, contents.keys())]
    lines = [*drawing.lines(after, rows), *drawing.neighbour_lines()]
    return GoldenUpdate(scene.folder, before, after, contents, lines, asks=any(text != _NEW for _, text in rows))


def _note_left(name: str, left: Set[int], job: FilmJob, reporter: Reporter) -> None:
    """Note the goldens that an update leaves as they are. left: the numbers of their frames."""
    if left:
        why = "were not drawn" if left & {*job.frames} else "the film does not have any more"
        numbers = first_few(sorted(left))
        reporter.note(f"{name}: goldens of frames that {why} stay: {numbers}; --prune removes them")


def plan_removals(unused: Sequence[GoldenFolder], options: GoldenOptions, reporter: Reporter) -> list[GoldenUpdate]:
    """Plan to remove the goldens that no scene has, if the options prune; else note each folder of an update."""
    if not options.prunes:
        for folder in unused if options.replaces else ():
            reporter.note(f"no scene has the goldens in {folder.path}: --prune removes them")
        return []
    updates = []
    for folder in unused:
        before = folder.find()
        if before is not None:
            lines = [f"{folder.path}: {counted(len(before.frames), 'golden')} removed, which no scene has"]
            updates.append(GoldenUpdate(folder, before, None, {}, lines, asks=True))
    return updates


def limit_of(scene: GoldenScene, record: GoldenRecord | None, job: FilmJob) -> Limit:
    """Return the limit of a scene: by its rules, else the same bytes, which bricks have on every processor.

    record: the content of golden.json; None for first goldens. Raises InputError for another limit than `same bytes`
    where only digests are kept.
    """
    if keeps_files(scene.rules, record):
        return scene.rules.limit or (_OPENGL_LIMIT if job.scene.at(0).needs_opengl else SAME_BYTES)
    if scene.rules.limit not in (None, SAME_BYTES):
        got = f"{scene.rules.limit}"
        raise InputError(LIMIT_OF_DIGESTS, where=f"limit of {scene.name}", got=got, hint=HINT_FOR_DIGESTS)
    return SAME_BYTES


def _frames(scene: GoldenScene, options: GoldenOptions, before: GoldenRecord | None, job: FilmJob) -> list[int]:
    """Return the frames that are drawn: of the option, or all that should have goldens, and, unless others are pruned,
    all that have some.
    """
    if options.frames is not None or before is None:
        return [*parse_frames(scene.rules.frames, job.scene.num_frames, job.frames)]
    found = {*selected_frames(scene.rules, before, job)}
    if not options.prunes:
        found |= before.by_frame.keys() & {*job.frames}
    if not found:
        raise InputError(
            "the scene has none of the frames that have goldens",
            where=str(scene.file),
            got=f"frames up to {job.frames[-1]}",
            expected=f"frame {before.frames[0].frame}, or others listed in {scene.folder.path}",
            hint="--update --frames : --prune draws all frames again",
        )
    return sorted(found)


def selected_frames(rules: SceneRules, record: GoldenRecord, job: FilmJob) -> list[int]:
    """Return the frames of a film that should have goldens: those that golden.yaml names, or else golden.json.

    Raises InputError if golden.yaml names frames, and the film has none of them.
    """
    there = frozenset(job.frames)
    try:
        picked = parse_frames(rules.frames or record.selection, job.scene.num_frames)
    except InputError:
        if rules.frames is not None:
            raise
        return []  # the film has become shorter
    return [number for number in picked if number in there]


def _selection(
    scene: GoldenScene, options: GoldenOptions, before: GoldenRecord | None, job: FilmJob, numbers: Sequence[int]
) -> str:
    """Return the slice of frames that golden.json names from now on.

    That of an option counts if it takes in more frames than the slice before, or if the others are pruned.
    """
    if before is None:
        return scene.rules.frames or ALL_FRAMES
    is_part = options.frames is not None and not options.prunes
    if is_part and not {*numbers} > {*selected_frames(SceneRules(), before, job)}:
        return before.selection
    return scene.rules.frames or before.selection


@dataclass(frozen=True)
class _Drawing:
    """The drawn frames of a scene, and the goldens before.

    limit: the limit of the scene. num_frames: the number of frames of its film.
    """

    scene: GoldenScene
    options: GoldenOptions
    before: GoldenRecord | None
    limit: Limit
    num_frames: int
    drawn: DrawnFrames

    def merged(self, selection: str) -> tuple[GoldenRecord, Mapping[str, Content]]:
        """Return the new content of golden.json, and functions that return the content of each new file."""
        merger = GoldenMerger(self.scene, self.before, self.drawn.origin, self.num_frames, also=self.options.also)
        for frame, file in self.drawn.files.items():
            picture, golden = read_picture(file), merger.goldens.get(frame)
            if self.options.also and golden and any(self._is_close(each, frame, picture) for each in golden.pictures):
                continue
            merger.merge(frame, picture_digest(picture), self.drawn.psnr.get(frame), partial(file_content, file))
        if self.options.prunes:
            merger.goldens = {frame: merger.goldens[frame] for frame in self.drawn.files}
        is_whole = merger.goldens.keys() == self.drawn.files.keys()
        return merger.record(selection, self.drawn.flicker if is_whole else None), merger.contents

    def _is_close(self, golden: GoldenPicture, frame: int, picture: Pixels) -> bool:
        """Return whether a drawn picture passes as a golden of the frame."""
        if golden.file is None or not self.scene.folder.holds(golden):
            return False
        stated = golden.psnr, self.drawn.psnr.get(frame)
        return compare_frame("", self.scene.folder.picture(golden.file), picture, self.limit, stated).passes

    def rows(self, after: GoldenRecord, written: Set[str]) -> Iterator[tuple[str, str]]:
        """Yield the file and the change of each golden that changes, in words. written: the names of new files."""
        goldens = self.before.by_frame if self.before else {}
        for frame in sorted(goldens.keys() | after.by_frame.keys()):
            change = self._change(goldens.get(frame), after.by_frame.get(frame), written)
            if change:
                yield golden_file_name(frame, self.num_frames), change

    def _change(self, before: Golden | None, after: Golden | None, written: Set[str]) -> str:
        """Return the change of a golden in words; an empty text without one."""
        if before is None or after is None:
            return "removed" if after is None else _NEW
        if {each.digest for each in before.pictures} <= {each.digest for each in after.pictures}:
            if before.files and not after.files:
                return "kept as a digest alone"
            return _NEW if len(after.pictures) > len(before.pictures) or written & {*after.files} else ""
        old = before.pictures[0]
        if old.file is None or not self.scene.folder.holds(old):
            return "other stored values"
        pictures = self.scene.folder.picture(old.file), read_picture(self.drawn.files[before.frame])
        return compare_frame("", *pictures, SAME_BYTES).why.partition(";")[0]

    def lines(self, after: GoldenRecord, rows: Sequence[tuple[str, str]]) -> list[str]:
        """Return the changes in words. rows: of the goldens."""
        if self.before is None:
            return [f"{self.scene.name}: {counted(len(after.frames), 'golden')}"]
        shown = rows[:_MOST_LINES]
        found = [f"{self.scene.name}: {counted(len(rows), 'golden')} of {len(self.before.frames)}"]
        found += [f"  {line}" for line in format_table(shown).splitlines()] if shown else []
        if len(rows) > len(shown):
            found.append(f"  and {len(rows) - len(shown)} more")
        if after.selection != self.before.selection:
            found.append(f"  frames {after.selection}, in place of {self.before.selection}")
        changes = [*changes_since(self.before, self.before.frames, self.drawn.origin, self.scene.file)]
        return [*found, *(f"  {change.words}" for change in changes[:MOST_CHANGES])]

    def neighbour_lines(self) -> Iterator[str]:
        """Yield a line on neighbouring frames that would pass as each other: the limit cannot tell them apart."""
        alike = []
        for (first, file), (second, other) in pairwise(self.drawn.files.items()):
            figures = measure_difference(read_picture(file), read_picture(other))
            if self.limit.passes(figures, (self.drawn.psnr.get(first), self.drawn.psnr.get(second))):
                alike.append(f"{first} and {second}")
        if alike:
            pairs = f"{counted(len(alike), 'pair')} of neighbouring goldens"
            yield f"note: at `{self.limit}`, {pairs} would pass as each other: {first_few(alike)}"


def update_goldens(updates: Sequence[GoldenUpdate], reporter: Reporter, ask: Callable[[], bool], *, yes: bool) -> bool:
    """Ask once whether goldens are replaced, if any are, with all changes; write them, and show each that is written.

    Return whether they were written. A film's goldens are written as a whole, or not at all.
    """
    asks = any(update.asks for update in updates) and not yes
    for line in [line for update in updates for line in update.lines] if asks else ():
        reporter.result(line)
    if asks and not ask():
        return False
    for number, update in enumerate(updates):
        try:
            state = update.apply()
        except KeyboardInterrupt:
            told = f"interrupted: the goldens of {number} of {counted(len(updates), 'film')} are written"
            reporter.result(f"{told}; the same command writes the others")
            raise
        for line in [*([] if asks else update.lines), state]:
            reporter.line(line)
    return True
