"""Draw goldens of scenes, or new ones after the user has seen the changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from hsplat_cli.compare.difference import measure_difference
from hsplat_cli.compare.frame_comparison import compare_frame
from hsplat_cli.compare.golden.drawing import DrawnFrames, default_limit, drawn_frames, load_golden_job
from hsplat_cli.compare.golden.project import GoldenScene
from hsplat_cli.compare.golden.record import (
    MOST_PICTURES,
    Golden,
    GoldenPicture,
    GoldenRecord,
    Origin,
    golden_file_name,
    picture_digest,
)
from hsplat_cli.compare.limit import SAME_BYTES, Limit
from hsplat_cli.compare.picture_file import decode_picture, file_content, read_picture
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter, format_table, parse_frames
from renderer.errors import InputError
from renderer.job import FilmJob
from renderer.scene import counted, first_few

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

    record: the new content of golden.json. contents: the content of each new file. lines: the change, in words. asks:
    whether goldens are replaced or removed, so that the user has to agree.
    """

    scene: GoldenScene
    record: GoldenRecord
    contents: Mapping[str, bytes]
    lines: Sequence[str]
    asks: bool

    def apply(self) -> None:
        """Write the change."""
        self.scene.folder.change(self.record, self.contents)


def plan_update(
    scene: GoldenScene, request: SceneRequest, options: GoldenOptions, reporter: Reporter
) -> GoldenUpdate | None:
    """Draw the frames of a scene, and plan how its goldens change; None if they do not.

    Raises InputError if the scene has goldens, and none of the options says what becomes of them.
    """
    before = scene.folder.find()
    if before is not None:
        scene.folder.unlisted(before)
    if before is not None and not (options.replaces or options.also):
        raise InputError(
            "this scene has goldens",
            where=str(scene.folder.path),
            hint="--update replaces them, --also keeps further ones for this machine",
        )
    job = load_golden_job(request)
    frames = _frames(scene, request.frames, before, job)
    limit = scene.rules.limit or default_limit(job)
    with drawn_frames(job, frames, reporter) as drawn:
        merger = _Merger(scene, before, drawn, job.scene.num_frames, options, limit)
        goldens = [merger.golden(frame) for frame in frames]
        lines = [*merger.lines(), *_neighbour_lines(drawn, frames, limit)]
        record = merger.record(goldens)
    removed = merger.removed
    if before == record and not merger.contents:
        return None
    return GoldenUpdate(scene, record, merger.contents, lines, merger.replaces or bool(removed))


def _frames(scene: GoldenScene, frames: str | None, before: GoldenRecord | None, job: FilmJob) -> list[int]:
    """Return the frames that are drawn: those of the option, or the golden ones, or those of the project."""
    if frames is None and before is not None:
        there = frozenset(job.frames)
        return [golden.frame for golden in before.frames if golden.frame in there]
    return [*parse_frames(frames or scene.rules.frames, job.scene.num_frames, job.frames)]


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
        self._origins = [*before.origins] if before else []
        self.contents = dict[str, bytes]()
        self.replaces = False
        self.removed = list[Golden]()
        self._rows = list[tuple[str, str]]()

    def golden(self, frame: int) -> Golden:
        """Return the golden of a drawn frame, with the pictures that it keeps."""
        content = file_content(self._drawn.files[frame])
        picture = decode_picture(content, self._drawn.files[frame])
        digest, before = picture_digest(picture), self._before.of_frame(frame) if self._before else None
        same = next((each for each in before.pictures if each.digest == digest), None) if before else None
        if same is not None and before is not None and (self._is_kept(same) or same.file is None):
            return before
        is_file = self._scene.rules.pictures != "digests"
        others = before.pictures if before is not None and self._options.also else ()
        if len(others) == MOST_PICTURES:
            raise InputError("too many goldens of a frame", where=f"{self._scene.folder.path}, frame {frame}")
        number = len(others) + 1
        name = golden_file_name(frame, self._num_frames, number) if is_file else None
        if name is not None:
            self.contents[name] = content
        self._note(frame, before, digest)
        psnr = self._drawn.psnr.get(frame)
        new = GoldenPicture(digest, self._origin(self._drawn.origin), name, psnr)
        return Golden(frame, (*others, new))

    def record(self, goldens: Sequence[Golden]) -> GoldenRecord:
        """Return the new content of golden.json, with the goldens of frames that were not drawn."""
        drawn = {golden.frame for golden in goldens}
        rest = [golden for golden in self._before.frames if golden.frame not in drawn] if self._before else []
        self.removed = rest if self._options.prunes else []
        kept = [] if self._options.prunes else rest
        frames = tuple(sorted([*goldens, *kept], key=lambda golden: golden.frame))
        return compact(GoldenRecord(tuple(self._origins), frames, None if kept else self._drawn.flicker))

    def lines(self) -> list[str]:
        """Return the changes in words."""
        found = [f"{self._scene.name}: {counted(len(self._rows), 'golden')}"]
        shown = self._rows[:_MAX_LINES] if self._before else []
        found += [f"  {line}" for line in format_table(shown).splitlines()] if shown else []
        if self._before and len(self._rows) > len(shown):
            found.append(f"  and {len(self._rows) - len(shown)} more")
        if self._before is not None:
            changes = self._before.origins[0].changes(self._drawn.origin)
            found += [f"  {key} was {was!r}, is now {now!r}" for key, was, now in changes[:_MAX_NAMES]]
        return found

    def _is_kept(self, picture: GoldenPicture) -> bool:
        """Return whether the file of a golden is there as golden.json describes it."""
        if picture.file is None:
            return True
        try:
            return picture_digest(read_picture(self._scene.folder.file(picture.file))) == picture.digest
        except InputError:
            return False

    def _origin(self, origin: Origin) -> int:
        if origin not in self._origins:
            self._origins.append(origin)
        return self._origins.index(origin)

    def _note(self, frame: int, before: Golden | None, digest: str) -> None:
        """Note the change of a golden for `lines`."""
        name = golden_file_name(frame, self._num_frames)
        if before is None or self._options.also:
            self._rows.append((name, "new"))
            return
        self.replaces = True
        old = before.pictures[0]
        if old.file is None or not self._is_kept(old):
            self._rows.append((name, "other stored values"))
            return
        pictures = read_picture(self._scene.folder.file(old.file)), read_picture(self._drawn.files[frame])
        self._rows.append((name, compare_frame(name, *pictures, SAME_BYTES).why.partition(";")[0]))


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
    """Show all changes, ask once if goldens are replaced, and write them. Return whether they were written."""
    asks = any(update.asks for update in updates) and not yes
    for update in updates:
        for line in update.lines:
            (reporter.result if asks else reporter.line)(line)
    if asks and not ask():
        return False
    for update in updates:
        update.apply()
        reporter.line(f"{update.scene.folder.path}: {counted(len(update.record.frames), 'golden')}")
    return True
