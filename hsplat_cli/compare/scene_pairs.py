"""Renders frames of a scene as `hsplat render` does, pairs its goldens with them, and notes changes of the scene."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from hsplat_cli.compare.file_pairs import read_pairs
from hsplat_cli.compare.golden.provenance import (
    GOLDEN_FILE,
    PROVENANCE,
    PROVENANCE_FILE,
    Golden,
    GoldenOrigin,
    Provenance,
    origin_from_record,
)
from hsplat_cli.compare.outcome import Pairs
from hsplat_cli.compare.picture_file import MAX_PIXELS, is_picture
from hsplat_cli.compare.rules import Rules
from hsplat_cli.scenes import SceneRequest, load_job
from hsplat_cli.terminal import FilmEvents, Reporter, parse_frames
from renderer.errors import InputError, RenderError
from renderer.film import frame_path
from renderer.job import FilmJob
from renderer.record import FilmRecord, MadeFile
from renderer.scene import MetricTarget, TimeBudget, counted, first_few, schedule_to_dict

_TEMPLATE = Path("frame-{frame}.png")
# Number of digits of a volume's fingerprint that messages show.
_SHOWN_DIGITS = 8


def load_numbered_job(request: SceneRequest) -> FilmJob:
    """Load the job that draws all frames of a scene, or of a film's sidecar, as numbered PNG files."""
    return load_job(replace(request, frames=None, output=_TEMPLATE), "nothing")


def load_reproducible_job(request: SceneRequest) -> FilmJob:
    """Load the job of a scene as `load_numbered_job` does, if its frames can be reproduced.

    Raises InputError if they depend on the machine's speed or on other frames, or are too large to be read again.
    """
    job = load_numbered_job(request)
    reasons = {
        TimeBudget: "frames within a time budget differ from run to run",
        MetricTarget: "frames for an accuracy depend on the other frames",
    }
    why = reasons.get(type(job.scene.error.goal))
    if why:
        (key,) = schedule_to_dict(job.scene.error)
        raise InputError(
            f"{why}, and cannot be golden",
            where=f"{request.path}: error.{key}",
            hint="render a film, and give the JSON file beside it in place of the scene: it has tolerances",
        )
    width, height = job.scene.output.size
    if width * height > MAX_PIXELS:
        got, expected = f"{width} x {height}", f"at most {MAX_PIXELS} pixels, as 8192 x 4096"
        raise InputError("too large to be compared", where=f"{request.path}: output.size", got=got, expected=expected)
    return job


@contextlib.contextmanager
def rendered_frames(
    job: FilmJob, frames: Sequence[int], reporter: Reporter
) -> Iterator[tuple[Mapping[int, Path], FilmRecord]]:
    """Render frames of a job of `load_reproducible_job`; yield their files, by number, and the record of the film.

    The files exist within the context. Raises HsplatError.
    """
    # Imported here: comparing files needs neither kernels nor OpenGL.
    from renderer.job import make_film, one_pass, open_local_executor

    try:
        temporary_folder = tempfile.TemporaryDirectory(prefix="hsplat-golden-")
    except OSError as error:
        hint = "set the environment variable TMPDIR to another folder"
        raise RenderError(
            "cannot create a temporary folder for frames", got=error.strerror or str(error), hint=hint
        ) from error
    with temporary_folder as folder:
        template = Path(folder) / _TEMPLATE
        output = replace(job.scene.output, file=template)
        scene = job.scene.changed(lambda each: replace(each, output=output))
        job = replace(job, scene=scene, frames=frames)
        with _DrawingEvents(reporter, job.scene.primitive_name) as events:
            result = make_film(job, open_local_executor, one_pass, events)
        assert result.shortfall is None, "a reproducible job has no goal to miss"
        yield {frame: frame_path(template, frame) for frame in frames}, result.film.record


class _DrawingEvents(FilmEvents):
    """Shows only the progress of drawing frames: their files are temporary, so their names and notes are not shown."""

    def started(self, label: str, num_frames: int) -> None:
        """Show a bar for the frames, without their temporary names."""
        super().started("drawing", num_frames)

    def note(self, text: str) -> None:
        """Print nothing."""


@contextlib.contextmanager
def open_scene_pairs(request: SceneRequest, folder: Path, rules: Rules, reporter: Reporter) -> Iterator[Pairs]:
    """Render the frames of a scene, or of a film's sidecar, that have goldens in a folder, and pair them.

    The pictures exist within the context. Raises InputError if the folder has no golden of the scene's frames, or
    goldens that golden.json does not list; SceneError if `rules` name frames that do not exist; and the errors of
    reading the scene and rendering.
    """
    provenance, unlisted = _read_folder(folder)
    job = load_reproducible_job(request)
    goldens = _select_goldens(provenance.frames, request.frames, job, folder)
    drawable = frozenset(job.frames)
    numbers = [golden.frame for golden in goldens if golden.frame in drawable]
    if not numbers:
        raise InputError(
            "the scene has none of the frames that have goldens",
            where=str(request.path),
            got=f"{counted(len(job.frames), 'frame')} up to frame {job.frames[-1]}",
            expected=f"frame {goldens[0].frame} or others listed in {folder / PROVENANCE_FILE}",
        )
    names = [golden.file for golden in goldens]
    rules.require_frames(names)  # an unknown frame is an error before rendering
    with rendered_frames(job, numbers, reporter) as (files, record):
        now = origin_from_record(record)
        notes = [*_origin_notes(provenance, now), *_file_notes(folder, goldens, unlisted), *record.notes]
        kept = {golden.file: path for golden in goldens if (path := folder / golden.file).exists()}
        drawn = {golden.file: files[golden.frame] for golden in goldens if golden.frame in files}
        yield Pairs(names, read_pairs(names, kept, drawn, are_recorded=True), notes, _facts(provenance, now))


def _read_folder(folder: Path) -> tuple[Provenance, Sequence[str]]:
    """Return the content of golden.json, and the pictures in the folder that it does not list.

    Raises InputError if the folder has no golden.json, or has an unlisted picture with the name of a golden.
    """
    hint = f"`hsplat golden SCENE {folder}` renders goldens and records their origin"
    try:
        names = {path.name for path in folder.iterdir() if is_picture(path.name)}
    except (FileNotFoundError, NotADirectoryError) as error:
        problem = "not a folder of goldens" if folder.exists() else "no such folder"
        raise InputError(problem, where=str(folder), hint=hint) from error
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(folder)) from error
    if not (folder / PROVENANCE_FILE).exists():
        raise InputError(
            f"no {PROVENANCE_FILE} in this folder",
            where=str(folder),
            got=counted(len(names), "PNG file"),
            hint=f"{hint}; a folder of frames is compared with another folder",
        )
    provenance = PROVENANCE.read(folder / PROVENANCE_FILE)
    unlisted = sorted(names - {golden.file for golden in provenance.frames})
    lost = list(filter(GOLDEN_FILE.fullmatch, unlisted))
    if lost:
        raise InputError(
            f"{PROVENANCE_FILE} does not list all goldens in this folder",
            where=str(folder),
            got=first_few(lost),
            hint=f"restore {PROVENANCE_FILE}, or move pictures that are not golden elsewhere",
        )
    return provenance, unlisted


def _select_goldens(goldens: Sequence[Golden], frames: str | None, job: FilmJob, folder: Path) -> Sequence[Golden]:
    """Return the goldens of the requested frames. Raises InputError if there are none."""
    if frames is None:
        return goldens
    requested = frozenset(parse_frames(frames, job.scene.num_frames))
    picked = [golden for golden in goldens if golden.frame in requested]
    if not picked:
        numbers = first_few([golden.frame for golden in goldens])
        raise InputError(
            "no goldens of these frames",
            where="--frames",
            got=frames,
            expected=f"frames listed in {folder / PROVENANCE_FILE}: {numbers}",
        )
    return picked


def _origin_notes(before: GoldenOrigin, now: GoldenOrigin) -> Iterator[str]:
    if before.volume.fingerprint != now.volume.fingerprint:
        yield f"another volume: {_volume(now)}; the goldens show {_volume(before)}"
    change = before.changes(now, "scene")
    if change:
        yield f"the scene has changed since the goldens were rendered: {change}"


def _file_notes(folder: Path, goldens: Sequence[Golden], unlisted: Sequence[str]) -> Iterator[str]:
    """Yield notes on goldens that are missing or changed, and on pictures in their folder that are no goldens."""
    gone = [golden.file for golden in goldens if not (folder / golden.file).exists()]
    made = [MadeFile(folder / golden.file, golden.digest) for golden in goldens if golden.file not in gone]
    changed = [each.path.name for each in made if not each.is_unchanged]
    if gone:
        yield f"missing goldens that {PROVENANCE_FILE} lists: {first_few(gone)}"
    if changed:
        yield f"changed by hand or by an interrupted update since {PROVENANCE_FILE} was written: {first_few(changed)}"
    if unlisted:
        yield f"not compared, because {PROVENANCE_FILE} does not list them: {first_few(unlisted)}"


def _facts(before: GoldenOrigin, now: GoldenOrigin) -> dict[str, tuple[str, str]]:
    """Return the device, the volume and the versions of packages by name, each as (when the goldens were made, now).

    Packages that only one of the origins lists are left out.
    """
    common = before.versions.keys() & now.versions
    versions = {name: (before.versions[name], now.versions[name]) for name in sorted(common)}
    return {"device": (before.device, now.device), "volume": (_volume(before), _volume(now)), **versions}


def _volume(origin: GoldenOrigin) -> str:
    volume = origin.volume
    shape = " x ".join(map(str, volume.shape))
    return f"{volume.name}, {shape} {volume.dtype}, fingerprint {volume.fingerprint[:_SHOWN_DIGITS]}"
