"""Draw a scene's frames that have goldens, or that its project names, and compare them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from hsplat_cli.compare.frame_comparison import compare_frame
from hsplat_cli.compare.golden.changes import changes_since
from hsplat_cli.compare.golden.drawing import (
    DrawnFrames,
    drawn_frames,
    load_golden_job,
    measure_nearness,
)
from hsplat_cli.compare.golden.golden_folder import GoldenFolder
from hsplat_cli.compare.golden.project import GoldenScene
from hsplat_cli.compare.golden.record import (
    Golden,
    GoldenPicture,
    GoldenRecord,
    Origin,
    golden_file_name,
    picture_digest,
)
from hsplat_cli.compare.golden.update import limit_of, selected_frames
from hsplat_cli.compare.limit import SAME_BYTES, Limit
from hsplat_cli.compare.outcome import ComparedFilm, ComparedFrame, Flickers, Mistake, ReportPicture
from hsplat_cli.compare.picture_file import decode_picture, file_content, read_picture
from hsplat_cli.compare.report_folder import PictureStore
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter, parse_frames
from renderer.errors import HsplatError, InputError, SceneError
from renderer.film import Pixels
from renderer.job import FilmJob
from renderer.scene import first_few

# The beginnings of the keys of a scene that decide how exactly it is drawn: the exact picture does not depend on them.
_PRECISION = ("scene.error.", "scene.splat.", "scene.pyramid.")
# The most frames of a film whose nearness to the exact picture is measured: the worst ones.
_MOST_NEARNESS = 3


def shown_place(path: Path) -> str:
    """Return a path as people name it: relative to the current folder, with forward slashes."""
    return Path(os.path.relpath(path)).as_posix()


def error_line(error: HsplatError) -> str:
    """Return the text of an error in one line."""
    return _in_one_line(str(error))


def _in_one_line(text: str) -> str:
    """Return a message in one line, without the excerpt of a file, whose lines begin with a bar."""
    return "; ".join(line.strip() for line in text.splitlines() if not line.strip().startswith("|"))


def _mistakes(error: HsplatError, file: Path) -> Iterator[Mistake]:
    """Yield the mistakes in the file of a scene that an error lists. A missing key is told at the first line."""
    for problem in error.problems if isinstance(error, SceneError) else ():
        line = (problem.location or "").removeprefix(f"{file}:").partition(":")[0]
        yield Mistake(_in_one_line(str(replace(problem, location=None))), int(line) if line.isdecimal() else 1)


def compare_scene(scene: GoldenScene, request: SceneRequest, store: PictureStore, reporter: Reporter) -> ComparedFilm:
    """Draw the frames of a scene that have goldens, and compare them. Frames that the project names, too, are drawn.

    request: the scene's file, with the options of the command line. An error is the outcome of a scene that cannot be
    compared.
    """
    places = shown_place(scene.file), shown_place(scene.folder.path)
    film = ComparedFilm(scene.name, str(scene.rules.limit or SAME_BYTES), *places)
    try:
        film = _compared(film, scene, request, store, reporter)
    except HsplatError as error:
        film = replace(film, error=error_line(error), mistakes=tuple(_mistakes(error, scene.file)))
    return store.settled(film)


def _compared(
    film: ComparedFilm, scene: GoldenScene, request: SceneRequest, store: PictureStore, reporter: Reporter
) -> ComparedFilm:
    """Return the outcome of a film whose frames are drawn and compared.

    Raises InputError if there is no golden of the scene's frames, and the errors of reading the scene and drawing.
    """
    folder = scene.folder
    record = folder.find()
    others = folder.unlisted(record)
    if record is None:
        hint = "`hsplat golden` draws and keeps them"
        if scene.former is not None:
            hint = f"if {scene.former.path} has them, `{scene.move_command}`"
        raise InputError("this scene has no goldens", where=str(scene.file), expected=str(folder.path), hint=hint)
    job = load_golden_job(request)
    limit = limit_of(scene, record, job)
    goldens, new = _selected(scene, record, request.frames, job)
    numbers = sorted({*new, *(golden.frame for golden in goldens)} & {*job.frames})
    if not numbers:
        raise InputError(
            "the scene has none of the frames that have goldens",
            where=str(scene.file),
            got=f"frames up to {job.frames[-1]}",
            expected=f"frame {goldens[0].frame} or others listed in {folder.path}",
        )
    with drawn_frames(job, numbers, reporter) as drawn:
        comparer = _Comparer(folder, record, drawn, limit, store)
        frames = []
        with reporter.progress(len(goldens), label="comparing") as bar:
            for golden in goldens:
                frames.append(comparer.compare(golden))
                bar.advance()
        failing = [golden for golden, frame in zip(goldens, frames, strict=True) if not frame.passes]
        new_frames = [comparer.show_new(number, job.scene.num_frames) for number in new]
        film = replace(
            film,
            limit=str(limit),
            changes=tuple(changes_since(record, failing or goldens, drawn.origin, scene.file)),
            notes=(*drawn.record.notes, *_notes(others, [*_outdated(record, goldens, frames, drawn.origin)])),
            origin=drawn.origin,
            frames_per_second=job.scene.output.frames_per_second,
            flicker=None if drawn.flicker is None else Flickers(drawn.flicker, record.flicker),
            frames=tuple(sorted([*frames, *new_frames], key=lambda frame: frame.frame or 0)),
        )
        return _with_nearness(film, job, comparer)


def _selected(
    scene: GoldenScene, record: GoldenRecord, frames: str | None, job: FilmJob
) -> tuple[Sequence[Golden], Sequence[int]]:
    """Return the goldens of the requested frames, and the requested frames that should have goldens, but have none.

    frames: the option of the command line; None for all frames. Raises InputError if there are none.
    """
    golden = {each.frame for each in record.frames}
    new = [number for number in selected_frames(scene.rules, record, job) if number not in golden]
    if frames is None:
        return record.frames, new
    requested = frozenset(parse_frames(frames, job.scene.num_frames))
    picked, new = [each for each in record.frames if each.frame in requested], [n for n in new if n in requested]
    if not picked and not new:
        numbers = f"{first_few(sorted(golden))}, as in {scene.folder.path}"
        raise InputError("no goldens of these frames", where="--frames", got=frames, expected=numbers)
    return picked, new


@dataclass(frozen=True)
class _Comparer:
    """Compares drawn frames with the goldens in a folder, and keeps their pictures in a report."""

    folder: GoldenFolder
    record: GoldenRecord
    drawn: DrawnFrames
    limit: Limit
    store: PictureStore

    def compare(self, golden: Golden) -> ComparedFrame:
        """Compare a frame with its goldens."""
        name = golden.pictures[0].file or f"frame {golden.frame}"
        file = self.drawn.files.get(golden.frame)
        if file is None:
            why = "the film does not have this frame any more"
            return ComparedFrame(name, "missing", why, golden.frame, old=self._old(golden.frame, golden.pictures[0]))
        content = file_content(file)
        actual = decode_picture(content, file)
        found = [
            replace(self._compare_one(name, picture, actual, golden.frame), golden=number)
            for number, picture in enumerate(golden.pictures, 1)
        ]
        frame = max(found, key=lambda each: each.rank)  # with the golden that it is most like
        old = self._old(golden.frame, golden.pictures[frame.golden - 1])
        return replace(frame, frame=golden.frame, old=old, new=self._new(golden.frame, actual, content))

    def show_new(self, number: int, num_frames: int) -> ComparedFrame:
        """Return the outcome of a drawn frame that has no golden, with its picture. num_frames: of the scene."""
        content = file_content(self.drawn.files[number])
        picture = decode_picture(content, self.drawn.files[number])
        frame = compare_frame(golden_file_name(number, num_frames), None, picture, self.limit)
        return replace(frame, frame=number, new=self._new(number, picture, content))

    def _old(self, number: int, golden: GoldenPicture) -> ReportPicture:
        """Keep a golden picture of a frame in the report, if it has a file."""
        if golden.file is None or not self.folder.file(golden.file).exists():
            return ReportPicture(golden.digest)
        picture, content = self.folder.picture(golden.file), file_content(self.folder.file(golden.file))
        return self.store.add("old", golden_file_name(number, number + 1), picture, content=content)

    def _new(self, number: int, picture: Pixels, content: bytes) -> ReportPicture:
        """Keep a drawn picture of a frame in the report."""
        name = golden_file_name(number, number + 1)
        return self.store.add("new", name, picture, self.drawn.psnr.get(number), content)

    def _compare_one(self, name: str, golden: GoldenPicture, actual: Pixels, number: int) -> ComparedFrame:
        if golden.file is None:
            return self._compare_digest(name, golden, actual)
        path = self.folder.file(golden.file)
        if not path.exists():
            return ComparedFrame(name, "missing", f"{golden.file} is missing, which golden.json lists")
        picture = self.folder.picture(golden.file)
        frame = compare_frame(name, picture, actual, self.limit, (golden.psnr, self.drawn.psnr.get(number)))
        if picture_digest(picture) != golden.digest:
            why = f"{golden.file} is not the picture that golden.json describes; {frame.why}"
            return replace(frame, status="different", why=why)
        return frame

    def _compare_digest(self, name: str, golden: GoldenPicture, actual: Pixels) -> ComparedFrame:
        """Compare a picture with a golden of which only the digest is kept."""
        if picture_digest(actual) == golden.digest:
            return compare_frame(name, actual, actual, SAME_BYTES)
        return ComparedFrame(name, "different", "other stored values than those of the golden's digest")

    def showing_same_scene(self, frame: ComparedFrame) -> tuple[Pixels, Pixels] | None:
        """Return the golden and the new picture of a frame.

        None if they have not one size, if the golden has no file, or if it shows another scene or volume, however
        exactly.
        """
        assert frame.frame is not None
        picture = self.record.by_frame[frame.frame].pictures[frame.golden - 1]
        changes = self.record.origins[picture.origin].changes(self.drawn.origin)
        is_same_scene = all(path.startswith(_PRECISION) for path, _, _ in changes)
        if not is_same_scene or picture.file is None or frame.part_psnr is None:
            return None
        return self.folder.picture(picture.file), read_picture(self.drawn.files[frame.frame])


def _with_nearness(film: ComparedFilm, job: FilmJob, comparer: _Comparer) -> ComparedFilm:
    """Return the outcome of a film, with the nearness of its worst frames to the exact pictures.

    It is left out where volume or scene changed, but for its precision: the exact picture is the new scene's, which the
    golden never showed.
    """
    different = [frame for frame in film.failing if frame.status == "different"]
    pairs = ((frame.frame or 0, comparer.showing_same_scene(frame)) for frame in different)
    pictures = dict(islice(((number, pair) for number, pair in pairs if pair is not None), _MOST_NEARNESS))
    found = measure_nearness(job, pictures) if pictures else {}
    return replace(film, frames=tuple(replace(each, nearer=found.get(each.frame or 0)) for each in film.frames))


def _outdated(
    record: GoldenRecord, goldens: Sequence[Golden], frames: Sequence[ComparedFrame], now: Origin
) -> Iterator[str]:
    """Yield goldens that were drawn by this device, but that it does not draw any more, while another one matched."""
    for golden, frame in zip(goldens, frames, strict=True):
        for number, picture in enumerate(golden.pictures, 1):
            is_own = record.origins[picture.origin].device == now.device
            if frame.passes and number != frame.golden and is_own:
                yield picture.file or f"frame {golden.frame}, golden {number}"


def _notes(unlisted: Sequence[str], outdated: Sequence[str]) -> Iterator[str]:
    if unlisted:
        yield f"not compared, because golden.json does not list them: {first_few(unlisted)}"
    if outdated:
        yield f"no picture matches these goldens any more: {first_few(outdated)}"
