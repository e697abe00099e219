"""Draw a scene's frames that have goldens, or that its project names, and compare them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hsplat_cli.compare.frame_comparison import compare_frame, nearest
from hsplat_cli.compare.golden.changes import changes_since
from hsplat_cli.compare.golden.drawing import (
    DrawnFrames,
    default_limit,
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
from hsplat_cli.compare.golden.update import frames_without_goldens
from hsplat_cli.compare.limit import SAME_BYTES, Limit
from hsplat_cli.compare.outcome import ComparedFilm, ComparedFrame, Flickers, ReportPicture
from hsplat_cli.compare.picture_file import decode_picture, file_content
from hsplat_cli.compare.report_folder import PictureStore
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter, parse_frames
from renderer.errors import InputError
from renderer.film import Pixels
from renderer.job import FilmJob
from renderer.scene import first_few

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
    if record is None:
        raise InputError(
            "this scene has no goldens",
            where=str(scene.file),
            expected=str(folder.path),
            hint="`hsplat golden` draws and keeps them",
        )
    others = folder.unlisted(record)
    job = load_golden_job(request)
    limit = scene.rules.limit or default_limit(job)
    goldens = _selected(record, request.frames, job, folder)
    drawable = frozenset(job.frames)
    numbers = [golden.frame for golden in goldens if golden.frame in drawable]
    if not numbers:
        raise InputError(
            "the scene has none of the frames that have goldens",
            where=str(scene.file),
            got=f"frames up to {job.frames[-1]}",
            expected=f"frame {goldens[0].frame} or others listed in {folder.path}",
        )
    new = [] if request.frames else frames_without_goldens(scene.rules.frames, record, job)
    with drawn_frames(job, sorted([*numbers, *new]), reporter) as drawn:
        comparer = _Comparer(folder, record, drawn, limit, store)
        frames = []
        with reporter.progress(len(goldens), label="comparing") as bar:
            for golden in goldens:
                frames.append(comparer.compare(golden))
                bar.advance()
        new_frames = [comparer.show_new(number, job.scene.num_frames) for number in new]
        film = ComparedFilm(
            scene.name,
            str(limit),
            place(scene.file),
            place(folder.path),
            changes=tuple(changes_since(record, goldens, drawn.origin, scene.file)),
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


def _selected(record: GoldenRecord, frames: str | None, job: FilmJob, folder: GoldenFolder) -> Sequence[Golden]:
    """Return the goldens of the requested frames. Raises InputError if there are none."""
    if frames is None:
        return record.frames
    requested = frozenset(parse_frames(frames, job.scene.num_frames))
    picked = [golden for golden in record.frames if golden.frame in requested]
    if not picked:
        numbers = first_few([golden.frame for golden in record.frames])
        raise InputError(
            "no goldens of these frames", where="--frames", got=frames, expected=f"{numbers}, as in {folder.path}"
        )
    return picked


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
            return replace(compare_frame(name, None, None, self.limit), frame=golden.frame)
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
        picture = golden.pictures[frame.golden - 1]
        old = ReportPicture(picture.digest, "", picture.psnr)
        if picture.file is not None and frame.status != "missing":
            old = self.store.add("old", kept, file_content(self.folder.file(picture.file)), old.digest, old.psnr)
        return replace(frame, frame=golden.frame, old=old, new=new)

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
        picture = decode_picture(file_content(path), path)
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

    def pictures(self, frame: ComparedFrame) -> tuple[Pixels, Pixels] | None:
        """Return the golden and the new picture of a frame; None unless both are of one size and known."""
        assert frame.frame is not None
        golden = self.record.of_frame(frame.frame)
        file = None if golden is None else golden.pictures[frame.golden - 1].file
        if file is None or frame.part_psnr is None:
            return None
        paths = self.folder.file(file), self.drawn.files[frame.frame]
        old, new = (decode_picture(file_content(path), path) for path in paths)
        return old, new


def _with_nearness(film: ComparedFilm, job: FilmJob, comparer: _Comparer) -> ComparedFilm:
    """Return the outcome of a film that fails, with the nearness of its worst frames to the exact pictures.

    It is left out where the goldens show another volume: what the golden should show is then not known.
    """
    if any(change.key.startswith("volume.fingerprint") for change in film.changes):
        return film
    chosen = [frame for frame in film.failing if frame.status == "different"][:_MOST_NEARNESS]
    pictures = {frame.frame: pair for frame in chosen if (pair := comparer.pictures(frame)) and frame.frame is not None}
    found = measure_nearness(job, pictures) if pictures else {}
    frames = [replace(each, nearer=found.get(each.frame)) if each.frame in found else each for each in film.frames]
    return replace(film, frames=tuple(frames))


def _flickers(record: GoldenRecord, drawn: DrawnFrames) -> Flickers | None:
    """Return the flicker of the goldens and of the drawn frames, if both are known."""
    if record.flicker is None or drawn.flicker is None:
        return None
    return Flickers(record.flicker, drawn.flicker)


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
