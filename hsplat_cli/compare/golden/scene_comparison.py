"""Draw a scene's frames that have goldens, or that its project names, and compare them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hsplat_cli.compare.frame_comparison import compare_frame, nearest
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
from hsplat_cli.compare.outcome import ComparedFilm, ComparedFrame, Flickers, ReportPicture
from hsplat_cli.compare.picture_file import decode_picture, file_content, read_picture
from hsplat_cli.compare.report_folder import PictureStore
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter, parse_frames
from renderer.errors import InputError
from renderer.film import Pixels
from renderer.job import FilmJob
from renderer.scene import first_few

# The beginnings of the keys of a scene that decide how exactly it is drawn: the exact picture does not depend on them.
_PRECISION = ("scene.error.", "scene.splat.", "scene.pyramid.")
# The most frames of a film whose nearness to the exact picture is measured: the worst ones.
_MOST_NEARNESS = 3


def compare_scene(
    scene: GoldenScene, request: SceneRequest, store: PictureStore, place: Callable[[Path], str], reporter: Reporter
) -> ComparedFilm:
    """Draw the frames of a scene that have goldens, and compare them. Frames that the project names, too, are drawn.

    request: the scene's file, with the options of the command line. place: returns a path as reports have it.
    Raises InputError if there is no golden of the scene's frames, and the errors of reading the scene and drawing.
    """
    folder = scene.folder
    record = folder.find()
    others = folder.unlisted(record)
    if record is None:
        raise InputError(
            "this scene has no goldens",
            where=str(scene.file),
            expected=str(folder.path),
            hint="`hsplat golden` draws and keeps them",
        )
    job = load_golden_job(request)
    limit = limit_of(scene, record, job)
    goldens, new = _selected(scene, record, request.frames, job)
    drawable = frozenset(job.frames)
    numbers = [*new, *(golden.frame for golden in goldens if golden.frame in drawable)]
    if not numbers:
        raise InputError(
            "the scene has none of the frames that have goldens",
            where=str(scene.file),
            got=f"frames up to {job.frames[-1]}",
            expected=f"frame {goldens[0].frame} or others listed in {folder.path}",
        )
    with drawn_frames(job, sorted(numbers), reporter) as drawn:
        comparer = _Comparer(folder, record, drawn, limit, store)
        frames = []
        with reporter.progress(len(goldens), label="comparing") as bar:
            for golden in goldens:
                frames.append(comparer.compare(golden))
                bar.advance()
        failing = [golden for golden, frame in zip(goldens, frames, strict=True) if not frame.passes]
        new_frames = [comparer.show_new(number, job.scene.num_frames) for number in new]
        film = ComparedFilm(
            scene.name,
            str(limit),
            place(scene.file),
            place(folder.path),
            changes=tuple(changes_since(record, failing or goldens, drawn.origin, scene.file)),
            notes=(*drawn.record.notes, *_notes(others)),
            outdated=tuple(_outdated(record, goldens, frames, drawn.origin)),
            origin=drawn.origin,
            frames_per_second=job.scene.output.frames_per_second,
            flicker=_flickers(record, drawn),
            frames=tuple(sorted([*frames, *new_frames], key=lambda frame: frame.frame or 0)),
        )
        if film.verdict == "passes":
            store.drop()
            return film.without_pictures
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
        stated = self.drawn.psnr.get(golden.frame)
        kept = golden_file_name(golden.frame, golden.frame + 1)
        found = [
            replace(self._compare_one(name, picture, actual, stated), golden=number)
            for number, picture in enumerate(golden.pictures, 1)
        ]
        frame = nearest(found)
        new = self.store.add("new", kept, content, picture_digest(actual), stated)
        old = self._old(golden.frame, golden.pictures[frame.golden - 1])
        return replace(frame, frame=golden.frame, old=old, new=new)

    def _old(self, number: int, picture: GoldenPicture) -> ReportPicture:
        """Keep a golden picture of a frame in the report, if it has a file."""
        digest = self.folder.shown_digest(picture)
        if picture.file is None or not self.folder.file(picture.file).exists():
            return ReportPicture(digest, "", picture.psnr)
        name, content = golden_file_name(number, number + 1), file_content(self.folder.file(picture.file))
        return self.store.add("old", name, content, digest, picture.psnr)

    def show_new(self, number: int, num_frames: int) -> ComparedFrame:
        """Return the outcome of a drawn frame that has no golden, with its picture. num_frames: of the scene."""
        file, name = self.drawn.files[number], golden_file_name(number, num_frames)
        content = file_content(file)
        picture = decode_picture(content, file)
        kept = golden_file_name(number, number + 1)
        new = self.store.add("new", kept, content, picture_digest(picture), self.drawn.psnr.get(number))
        return replace(compare_frame(name, None, picture, self.limit), frame=number, new=new)

    def _compare_one(self, name: str, golden: GoldenPicture, actual: Pixels, stated: float | None) -> ComparedFrame:
        if golden.file is None:
            return self._compare_digest(name, golden, actual)
        path = self.folder.file(golden.file)
        if not path.exists():
            return ComparedFrame(name, "missing", f"{golden.file} is missing, which golden.json lists")
        picture = self.folder.picture(golden.file)
        both = None if golden.psnr is None or stated is None else (golden.psnr, stated)
        frame = compare_frame(name, picture, actual, self.limit, both)
        if picture_digest(picture) != golden.digest:
            why = f"{golden.file} is not the picture that golden.json describes; {frame.why}"
            return replace(frame, status="different", why=why)
        return frame

    def _compare_digest(self, name: str, golden: GoldenPicture, actual: Pixels) -> ComparedFrame:
        """Compare a picture with a golden of which only the digest is kept."""
        if picture_digest(actual) == golden.digest:
            return compare_frame(name, actual, actual, SAME_BYTES)
        return ComparedFrame(name, "different", "other stored values than those of the golden's digest")

    def shows_same_scene(self, frame: ComparedFrame) -> bool:
        """Return whether the golden of a frame shows the scene and the volume as they are now, however exactly."""
        golden = None if frame.frame is None else self.record.of_frame(frame.frame)
        if golden is None:
            return False
        origin = self.record.origins[golden.pictures[frame.golden - 1].origin]
        return all(path.startswith(_PRECISION) for path, _, _ in origin.changes(self.drawn.origin))

    def pictures(self, frame: ComparedFrame) -> tuple[Pixels, Pixels] | None:
        """Return the golden and the new picture of a frame; None unless both are of one size and known."""
        assert frame.frame is not None
        golden = self.record.of_frame(frame.frame)
        file = None if golden is None else golden.pictures[frame.golden - 1].file
        if file is None or frame.part_psnr is None:
            return None
        return self.folder.picture(file), read_picture(self.drawn.files[frame.frame])


def _with_nearness(film: ComparedFilm, job: FilmJob, comparer: _Comparer) -> ComparedFilm:
    """Return the outcome of a film that fails, with the nearness of its worst frames to the exact pictures.

    It is left out where volume or scene changed, but for its precision: the exact picture is the new scene's, which the
    golden never showed.
    """
    different = [frame for frame in film.failing if frame.status == "different"]
    chosen = [frame for frame in different if comparer.shows_same_scene(frame)][:_MOST_NEARNESS]
    pictures = {frame.frame: pair for frame in chosen if (pair := comparer.pictures(frame)) and frame.frame is not None}
    found = measure_nearness(job, pictures) if pictures else {}
    frames = [replace(each, nearer=found.get(each.frame)) if each.frame in found else each for each in film.frames]
    return replace(film, frames=tuple(frames))


def _flickers(record: GoldenRecord, drawn: DrawnFrames) -> Flickers | None:
    """Return the flicker of the drawn frames, and of the goldens, if they are known."""
    return None if drawn.flicker is None else Flickers(drawn.flicker, record.flicker)


def _outdated(
    record: GoldenRecord, goldens: Sequence[Golden], frames: Sequence[ComparedFrame], now: Origin
) -> Iterator[str]:
    """Yield goldens that were drawn by this device, but that it does not draw any more, while another one matched."""
    for golden, frame in zip(goldens, frames, strict=True):
        for number, picture in enumerate(golden.pictures, 1):
            is_own = record.origins[picture.origin].device == now.device
            if frame.passes and number != frame.golden and is_own:
                yield picture.file or f"frame {golden.frame}, golden {number}"


def _notes(unlisted: Sequence[str]) -> Iterator[str]:
    if unlisted:
        yield f"not compared, because golden.json does not list them: {first_few(unlisted)}"
