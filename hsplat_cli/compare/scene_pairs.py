"""A scene against its goldens: it is drawn again, and what has changed since is told."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hsplat_cli.compare.figure_format import printable
from hsplat_cli.compare.golden.provenance import (
    PROVENANCE_FILE,
    Golden,
    Provenance,
    describe_changes,
    is_golden_file_name,
    read_provenance,
)
from hsplat_cli.compare.golden.render import RenderedFrames, load_reproducible_job, rendered_frames
from hsplat_cli.compare.pair import Pair
from hsplat_cli.compare.picture_file import is_picture, read_picture
from hsplat_cli.compare.rules import Rules
from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import counted, first_few, parse_frames, report_first_run
from renderer.errors import InputError
from renderer.film import file_matches_digest

_SHOWN_DIGITS = 8
_MAX_NAMES = 3


@dataclass(frozen=True)
class ScenePairs:
    """Goldens and the same frames drawn now: pairs one at a time, as often as they are asked for.

    facts, notes: as in Comparison.
    """

    folder: Path
    goldens: Sequence[Golden]
    drawing: RenderedFrames
    facts: Mapping[str, tuple[str, str]]
    notes: Sequence[str]

    @property
    def names(self) -> Sequence[str]:
        """Of all pairs: those of the goldens' files."""
        return [golden.file for golden in self.goldens]

    def __iter__(self) -> Iterator[Pair]:
        """By number; without a golden where the file is not there, and without the other where the scene has no such
        frame any more. Raises InputError."""
        for golden in self.goldens:
            path, source = self.folder / golden.file, self.drawing.files.get(golden.frame)
            yield Pair(
                golden.file,
                read_picture(path) if path.exists() else None,
                None if source is None else read_picture(source),
                golden.frame,
                is_golden_missing=not path.exists(),
            )


@dataclass(frozen=True)
class SceneOptions:
    """How a scene is drawn, as the options of the command line say it."""

    frames: str | None = None
    overrides: Sequence[str] = ()
    volume: Path | None = None
    workers: int | None = None

    @property
    def given(self) -> list[str]:
        """The options that are there."""
        values = {"--frames": self.frames, "--set": self.overrides, "--volume": self.volume, "--workers": self.workers}
        return [option for option, value in values.items() if value]


@contextlib.contextmanager
def open_scene_pairs(
    scene: Path, folder: Path, options: SceneOptions, rules: Rules, *, quiet: bool
) -> Iterator[ScenePairs]:
    """Draw the frames of a scene, or of a film's sidecar, of which a folder has goldens, or some of them.

    The pictures are gone after the block. Raises InputError where the folder has no goldens, none of these frames, or
    goldens that its golden.json does not tell of, SceneError where `rules` are of frames that are not there, and what
    reading the scene and drawing raise.
    """
    provenance = _require_provenance(folder)
    unlisted = _unlisted_pictures(folder, provenance.goldens)
    job = load_reproducible_job(scene, overrides=options.overrides, volume=options.volume)
    goldens = _select_goldens(provenance.goldens, options.frames, job, folder)
    drawable = frozenset(job.frames)
    numbers = [golden.frame for golden in goldens if golden.frame in drawable]
    if not numbers:
        raise InputError(
            "the scene has none of the frames of which there are goldens",
            where=str(scene),
            got=f"{counted(len(job.frames), 'frame')} up to frame {job.frames[-1]}",
            expected=f"such as frame {goldens[0].frame}, which is in {folder / PROVENANCE_FILE}",
        )
    rules.require_frames([golden.file for golden in goldens])  # before it takes time
    report_first_run(quiet=quiet)
    with rendered_frames(job, numbers, ExecutorSpec(options.workers), quiet=quiet) as drawing:
        notes = [*_notes(provenance.origin, drawing.origin), *_file_notes(folder, goldens, unlisted), *drawing.notes]
        yield ScenePairs(folder, goldens, drawing, _facts(provenance, drawing.origin), notes)


def _require_provenance(folder: Path) -> Provenance:
    try:
        if (folder / PROVENANCE_FILE).exists():
            return read_provenance(folder)
        num = sum(is_picture(path.name) for path in folder.iterdir())
    except (FileNotFoundError, NotADirectoryError) as error:
        what = "not a folder of goldens" if folder.exists() else "no such folder"
        raise InputError(what, where=str(folder), hint=_MAKE.format(folder)) from error
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(folder)) from error
    raise InputError(
        f"no {PROVENANCE_FILE} in this folder says which frames of a scene are golden",
        where=str(folder),
        got=f"{num} PNG file{'s' * (num != 1)}",
        hint=f"{_MAKE.format(folder)}; a folder of frames is compared with another folder",
    )


_MAKE = "`hsplat golden SCENE {}` draws goldens, and writes down what from"


def _unlisted_pictures(folder: Path, goldens: Sequence[Golden]) -> Sequence[str]:
    """Pictures in the folder that golden.json does not tell of, none of which has the name of a golden.

    Raises InputError where some are: no update leaves such a file, so golden.json has lost them, and what is not
    compared cannot pass; and where the folder cannot be looked into.
    """
    try:
        names = {path.name for path in folder.iterdir() if is_picture(path.name)}
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(folder)) from error
    others = sorted(names - {golden.file for golden in goldens})
    lost = [name for name in others if is_golden_file_name(name)]
    if lost:
        raise InputError(
            f"{PROVENANCE_FILE} does not tell of all goldens in this folder",
            where=str(folder),
            got=_some(lost),
            hint=f"restore {PROVENANCE_FILE}; or move what is not golden away",
        )
    return others


def _select_goldens(goldens: Sequence[Golden], frames: str | None, job: Job, folder: Path) -> Sequence[Golden]:
    """Those that are in this range of frames. Raises InputError where there are none."""
    if frames is None:
        return goldens
    asked = frozenset(parse_frames(frames, job.scene.camera.path.frames))
    picked = [golden for golden in goldens if golden.frame in asked]
    if not picked:
        numbers = _some([golden.frame for golden in goldens])
        raise InputError(
            "there are no goldens of these frames",
            where="--frames",
            got=frames,
            expected=f"frames of which {folder / PROVENANCE_FILE} tells: {numbers}",
        )
    return picked


# What has changed


def _notes(provenance: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    if provenance["volume"]["fingerprint"] != now["volume"]["fingerprint"]:
        yield f"another volume: {_volume(now)}; the goldens are of {_volume(provenance)}"
    scene = describe_changes(provenance, now, "scene")
    if scene:
        yield f"the scene has changed since the goldens were drawn: {scene}"


def _file_notes(folder: Path, goldens: Sequence[Golden], unlisted: Sequence[str]) -> Iterator[str]:
    """On goldens that are not there, or are not the files that were written, and on pictures that are no goldens."""
    gone = [golden.file for golden in goldens if not (folder / golden.file).exists()]
    others = [
        golden.file
        for golden in goldens
        if (folder / golden.file).exists() and not file_matches_digest(folder / golden.file, golden.digest)
    ]
    if gone:
        yield f"missing goldens that {PROVENANCE_FILE} lists: {_some(gone)}"
    if others:
        yield f"changed by hand or by an interrupted update since {PROVENANCE_FILE} was written: {_some(others)}"
    if unlisted:
        names = [printable(name) for name in unlisted]
        yield f"not compared, because {PROVENANCE_FILE} does not list them: {_some(names)}"


def _some(items: Sequence[object]) -> str:
    return first_few(items, _MAX_NAMES)


def _facts(provenance: Provenance, now: Mapping[str, Any]) -> dict[str, tuple[str, str]]:
    """About the goldens and about now: the driver, the volume, versions of what is there on both sides."""
    origin = provenance.origin
    versions = {
        name: (origin["versions"][name], version)
        for name, version in now["versions"].items()
        if name in origin["versions"]
    }
    return {"driver": (origin["gl"], now["gl"]), "volume": (_volume(origin), _volume(now)), **versions}


def _volume(origin: Mapping[str, Any]) -> str:
    volume = origin["volume"]
    shape = " x ".join(map(str, volume["shape"]))
    return f"{volume['name']}, {shape} {volume['dtype']}, fingerprint {volume['fingerprint'][:_SHOWN_DIGITS]}"
