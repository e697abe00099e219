"""Draw goldens of scenes, or new ones after the user has seen the changes."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

from hsplat_cli.compare.ci_files import change_text
from hsplat_cli.compare.difference import measure_difference
from hsplat_cli.compare.frame_comparison import compare_frame
from hsplat_cli.compare.golden.changes import changes_since
from hsplat_cli.compare.golden.drawing import DrawnFrames, default_limit, drawn_frames, load_golden_job
from hsplat_cli.compare.golden.golden_folder import Content, GoldenFolder
from hsplat_cli.compare.golden.project import GoldenScene, SceneRules
from hsplat_cli.compare.golden.record import (
    ALL_FRAMES,
    MOST_PICTURES,
    Golden,
    GoldenPicture,
    GoldenRecord,
    Origin,
    golden_file_name,
    picture_digest,
)
from hsplat_cli.compare.limit import HINT_FOR_DIGESTS, LIMIT_OF_DIGESTS, SAME_BYTES, Limit
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
# The largest number of changed goldens that the terminal lists.
_MAX_LINES = 20
# The largest number of frames that a line names.
_MAX_NAMES = 8


@dataclass(frozen=True)
class GoldenOptions:
    """The options of `hsplat golden`.

    replaces: whether goldens that exist may be replaced. also: whether new pictures become further goldens beside them,
    for a machine that draws other ones. prunes: whether goldens of other frames are removed.
    """

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
        if self.before is not None:
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


def scenes_to_draw(scenes: Sequence[GoldenScene], options: GoldenOptions, reporter: Reporter) -> list[GoldenScene]:
    """Return the scenes whose goldens are drawn: without `--update` or `--also`, those that have none.

    Raises InputError if all have goldens, and none of the options says what becomes of them.
    """
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


def plan_update(
    scene: GoldenScene, frames: str | None, options: GoldenOptions, reporter: Reporter, drawings: ExitStack
) -> GoldenUpdate | None:
    """Draw the frames of a scene, and plan how its goldens change; None if they do not.

    frames: the option of the command line. drawings: keeps the drawn files until the plan has been carried out.
    """
    scene.folder.finish()
    before = scene.folder.find()
    scene.folder.unlisted(before)
    job = load_golden_job(SceneRequest(scene.file))
    numbers = _frames(scene, frames, before, job, prunes=options.prunes)
    names = {golden_file_name(frame, job.scene.num_frames) for frame in numbers} | (before.files if before else set())
    scene.folder.require_changeable(names, job.input_files())
    limit = limit_of(scene, before, job)
    drawn = drawings.enter_context(drawn_frames(job, numbers, reporter))
    merger = _Merger(scene, before, drawn, job.scene.num_frames, options, limit)
    goldens = [merger.golden(frame) for frame in numbers]
    after = merger.record(goldens, _selection(scene, frames, before, job, numbers, prunes=options.prunes))
    if before is not None and replace(after, flicker=before.flicker) == before and not merger.contents:
        return None
    lines = [*merger.lines(after), *_neighbour_lines(drawn, numbers, limit)]
    return GoldenUpdate(scene.folder, before, after, merger.contents, lines, merger.replaces)


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
    """Return the limit of a scene. record: the content of golden.json; None for first goldens.

    Raises InputError for another limit than `same bytes` where only digests are kept.
    """
    if keeps_files(scene.rules, record):
        return scene.rules.limit or default_limit(job)
    if scene.rules.limit not in (None, SAME_BYTES):
        got = f"{scene.rules.limit}"
        raise InputError(LIMIT_OF_DIGESTS, where=f"limit of {scene.name}", got=got, hint=HINT_FOR_DIGESTS)
    return SAME_BYTES


def _frames(
    scene: GoldenScene, frames: str | None, before: GoldenRecord | None, job: FilmJob, *, prunes: bool
) -> list[int]:
    """Return the frames that are drawn: of the option, or all that should have goldens, and, unless others are pruned,
    all that have some.
    """
    if frames is not None or before is None:
        return [*parse_frames(scene.rules.frames, job.scene.num_frames, job.frames)]
    there = frozenset(job.frames)
    found = {*selected_frames(scene.rules, before, job)}
    if not prunes:
        found |= {golden.frame for golden in before.frames if golden.frame in there}
    if not found:
        raise InputError(
            "the scene has none of the frames that have goldens",
            where=str(scene.file),
            got=f"frames up to {job.frames[-1]}",
            expected=f"frame {before.frames[0].frame}, or others listed in {scene.folder.path}",
            hint="--update --frames : --prune draws all frames anew",
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
    scene: GoldenScene,
    frames: str | None,
    before: GoldenRecord | None,
    job: FilmJob,
    numbers: Sequence[int],
    *,
    prunes: bool,
) -> str:
    """Return the slice of frames that golden.json names from now on.

    That of an option counts if it takes in more frames than the slice before, or if the others are pruned.
    """
    if before is None:
        return scene.rules.frames or ALL_FRAMES
    is_part = frames is not None and not prunes
    if is_part and not set(numbers) > {*selected_frames(SceneRules(), before, job)}:
        return before.selection
    return scene.rules.frames or before.selection


def keeps_files(rules: SceneRules, before: GoldenRecord | None) -> bool:
    """Return whether goldens are kept as files: by the rules, else as they are kept so far."""
    if rules.pictures is not None:
        return rules.pictures == "files"
    return before is None or bool(before.files)


class _Merger:
    """Merges drawn frames into the goldens of a scene, and keeps account of what changes."""

    def __init__(
        self,
        scene: GoldenScene,
        before: GoldenRecord | None,
        drawn: DrawnFrames,
        num_frames: int,
        options: GoldenOptions,
        limit: Limit,
    ) -> None:
        self._scene, self._before, self._drawn = scene, before, drawn
        self._num_frames, self._options, self._limit = num_frames, options, limit
        self._keeps_files = keeps_files(scene.rules, before)
        self._origins = [*before.origins] if before else []
        self.contents = dict[str, Content]()
        self.replaces = False
        self._rows = list[tuple[str, str]]()

    def golden(self, frame: int) -> Golden:
        """Return the golden of a drawn frame, with the pictures that it keeps."""
        picture, before = read_picture(self._drawn.files[frame]), self._before.of_frame(frame) if self._before else None
        digest = picture_digest(picture)
        if before is not None:
            same = next((each for each in before.pictures if each.digest == digest), None)
            if same is not None:
                return self._kept(before, same)
            if self._options.also and any(self._is_close(each, frame, picture) for each in before.pictures):
                return before
        self._note(frame, before)
        psnr = self._drawn.psnr.get(frame)
        new = GoldenPicture(digest, self._origin(self._drawn.origin), None, psnr)
        golden = with_picture(frame, before, new, also=self._options.also)
        return self._with_file(golden, new) if self._keeps_files else golden

    def _kept(self, golden: Golden, same: GoldenPicture) -> Golden:
        """Return a golden of which a picture was drawn again: with a file that was missing, or without files."""
        if self._keeps_files:
            is_there = same.file is not None and self._scene.folder.holds(same)
            return golden if is_there else self._with_file(golden, same)
        if any(picture.file is not None for picture in golden.pictures):
            self.replaces = True
            self._rows.append((golden_file_name(golden.frame, self._num_frames), "kept as a digest alone"))
        return replace(golden, pictures=tuple(replace(picture, file=None) for picture in golden.pictures))

    def _with_file(self, golden: Golden, picture: GoldenPicture) -> Golden:
        """Return a golden whose drawn picture has a file."""
        name = picture.file or golden_file_name(golden.frame, self._num_frames, golden.free_number)
        self.contents[name] = partial(file_content, self._drawn.files[golden.frame])
        return replace(
            golden, pictures=tuple(replace(each, file=name) if each is picture else each for each in golden.pictures)
        )

    def _is_close(self, golden: GoldenPicture, frame: int, picture: Pixels) -> bool:
        """Return whether a drawn picture passes as a golden of the frame."""
        if golden.file is None or not self._scene.folder.holds(golden):
            return False
        other = self._scene.folder.picture(golden.file)
        psnr = self._drawn.psnr.get(frame)
        stated = None if golden.psnr is None or psnr is None else (golden.psnr, psnr)
        return compare_frame("", other, picture, self._limit, stated).passes

    def record(self, goldens: Sequence[Golden], selection: str) -> GoldenRecord:
        """Return the new content of golden.json, with the goldens of frames that were not drawn."""
        drawn = {golden.frame for golden in goldens}
        rest = [golden for golden in self._before.frames if golden.frame not in drawn] if self._before else []
        if rest and self._options.prunes:
            self.replaces = True
            self._rows += [(golden_file_name(each.frame, self._num_frames), "removed") for each in rest]
        kept = [] if self._options.prunes else rest
        frames = tuple(sorted([*goldens, *kept], key=lambda golden: golden.frame))
        return compact(GoldenRecord(tuple(self._origins), frames, selection, None if kept else self._drawn.flicker))

    def lines(self, after: GoldenRecord) -> list[str]:
        """Return the changes in words."""
        if self._before is None:
            return [f"{self._scene.name}: {counted(len(after.frames), 'golden')}"]
        shown = self._rows[:_MAX_LINES]
        found = [f"{self._scene.name}: {counted(len(self._rows), 'golden')} of {len(self._before.frames)}"]
        found += [f"  {line}" for line in format_table(shown).splitlines()] if shown else []
        if len(self._rows) > len(shown):
            found.append(f"  and {len(self._rows) - len(shown)} more")
        if after.selection != self._before.selection:
            found.append(f"  frames {after.selection}, in place of {self._before.selection}")
        changes = [*changes_since(self._before, self._before.frames, self._drawn.origin, self._scene.file)]
        return [*found, *(f"  {change_text(change)}" for change in changes[:_MAX_NAMES])]

    def _origin(self, origin: Origin) -> int:
        if origin not in self._origins:
            self._origins.append(origin)
        return self._origins.index(origin)

    def _note(self, frame: int, before: Golden | None) -> None:
        """Note the change of a golden for `lines`."""
        name = golden_file_name(frame, self._num_frames)
        if before is None or self._options.also:
            self._rows.append((name, "new"))
            return
        self.replaces = True
        old = before.pictures[0]
        if old.file is None or not self._scene.folder.holds(old):
            self._rows.append((name, "other stored values"))
            return
        pictures = self._scene.folder.picture(old.file), read_picture(self._drawn.files[frame])
        self._rows.append((name, compare_frame(name, *pictures, SAME_BYTES).why.partition(";")[0]))


def with_picture(frame: int, before: Golden | None, picture: GoldenPicture, *, also: bool) -> Golden:
    """Return the golden of a frame with another picture, beside those that it has or in place of them.

    Raises InputError if it would have too many.
    """
    others = before.pictures if before is not None and also else ()
    if len(others) == MOST_PICTURES:
        raise InputError(f"frame {frame} has {MOST_PICTURES} goldens, the most that it can have", where="--also")
    return Golden(frame, (*others, picture))


def compact(record: GoldenRecord) -> GoldenRecord:
    """Return a record without the origins that no picture has."""
    used = sorted({picture.origin for golden in record.frames for picture in golden.pictures})
    numbers = {origin: number for number, origin in enumerate(used)}

    def renumbered(golden: Golden) -> Golden:
        pictures = [replace(picture, origin=numbers[picture.origin]) for picture in golden.pictures]
        return replace(golden, pictures=tuple(pictures))

    return replace(
        record, origins=tuple(record.origins[number] for number in used), frames=tuple(map(renumbered, record.frames))
    )


def _neighbour_lines(drawn: DrawnFrames, frames: Sequence[int], limit: Limit) -> list[str]:
    """Return a line on neighbouring goldens that would pass as each other: the limit cannot tell them apart."""
    alike = []
    for first, second in pairwise(frames):
        figures = measure_difference(read_picture(drawn.files[first]), read_picture(drawn.files[second]))
        known = first in drawn.psnr and second in drawn.psnr
        if limit.passes(figures, (drawn.psnr[first], drawn.psnr[second]) if known else None):
            alike.append(f"{first} and {second}")
    if not alike:
        return []
    return [f"note: at `{limit}`, {counted(len(alike), 'pair')} of neighbouring goldens would pass as each other: "
            f"{first_few(alike)}"]  # fmt: skip


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
