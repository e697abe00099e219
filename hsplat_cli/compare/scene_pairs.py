"""Pair a scene's goldens with the same frames rendered now, and note what has changed since."""

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
from hsplat_cli.compare.golden.render import load_reproducible_job, rendered_frames
from hsplat_cli.compare.pair import Pair, Pairs
from hsplat_cli.compare.picture_file import is_picture, read_picture
from hsplat_cli.compare.rules import Rules
from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import Reporter, counted, first_few, parse_frames
from renderer.errors import InputError
from renderer.film import file_matches_digest

_SHOWN_DIGITS = 8
_MAX_NAMES = 3


def _read_pairs(folder: Path, goldens: Sequence[Golden], files: Mapping[int, Path]) -> Iterator[Pair]:
    for golden in goldens:
        path, source = folder / golden.file, files.get(golden.frame)
        yield Pair(
            golden.file,
            read_picture(path) if path.exists() else None,
            None if source is None else read_picture(source),
            golden.frame,
            is_golden_missing=not path.exists(),
        )


@dataclass(frozen=True)
class SceneOptions:
    """The options of the command line for rendering a scene."""

    frames: str | None = None
    overrides: Sequence[str] = ()
    volume: Path | None = None
    workers: int | None = None

    @property
    def given(self) -> list[str]:
        """Names of the options with a value."""
        values = {"--frames": self.frames, "--set": self.overrides, "--volume": self.volume, "--workers": self.workers}
        return [option for option, value in values.items() if value]


@contextlib.contextmanager
def open_scene_pairs(
    scene: Path, folder: Path, options: SceneOptions, rules: Rules, reporter: Reporter
) -> Iterator[Pairs]:
    """Render the frames of a scene, or of a film's sidecar, that have goldens in a folder. Pictures last for the block.

    Raises InputError if the folder has none of these goldens, or goldens that golden.json does not list; SceneError if
    `rules` name frames that do not exist; and the errors of reading the scene and rendering.
    """
    provenance = _require_provenance(folder)
    unlisted = _unlisted_pictures(folder, provenance.goldens)
    job = load_reproducible_job(scene, overrides=options.overrides, volume=options.volume)
    goldens = _select_goldens(provenance.goldens, options.frames, job, folder)
    drawable = frozenset(job.frames)
    numbers = [golden.frame for golden in goldens if golden.frame in drawable]
    if not numbers:
        raise InputError(
            "the scene has none of the frames that have goldens",
            where=str(scene),
            got=f"{counted(len(job.frames), 'frame')} up to frame {job.frames[-1]}",
            expected=f"frame {goldens[0].frame} or others listed in {folder / PROVENANCE_FILE}",
        )
    rules.require_frames([golden.file for golden in goldens])  # before rendering
    reporter.announce_compilation()
    with rendered_frames(job, numbers, ExecutorSpec(options.workers), reporter) as rendered:
        notes = [*_notes(provenance.origin, rendered.origin), *_file_notes(folder, goldens, unlisted), *rendered.notes]
        names = [golden.file for golden in goldens]
        facts = _facts(provenance, rendered.origin)
        yield Pairs(names, lambda: _read_pairs(folder, goldens, rendered.files), notes, facts)


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
        f"no {PROVENANCE_FILE} in this folder",
        where=str(folder),
        got=counted(num, "PNG file"),
        hint=f"{_MAKE.format(folder)}; a folder of frames is compared with another folder",
    )


_MAKE = "`hsplat golden SCENE {}` renders goldens and records their origin"


def _unlisted_pictures(folder: Path, goldens: Sequence[Golden]) -> Sequence[str]:
    """Return pictures in the folder that golden.json does not list.

    Raises InputError if one is named like a golden, because golden.json is then incomplete, or if the folder cannot be
    read.
    """
    try:
        names = {path.name for path in folder.iterdir() if is_picture(path.name)}
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", where=str(folder)) from error
    others = sorted(names - {golden.file for golden in goldens})
    lost = [name for name in others if is_golden_file_name(name)]
    if lost:
        raise InputError(
            f"{PROVENANCE_FILE} does not list all goldens in this folder",
            where=str(folder),
            got=_some(lost),
            hint=f"restore {PROVENANCE_FILE}, or move pictures that are not golden elsewhere",
        )
    return others


def _select_goldens(goldens: Sequence[Golden], frames: str | None, job: Job, folder: Path) -> Sequence[Golden]:
    """Return the goldens in a range of frames. Raises InputError if there are none."""
    if frames is None:
        return goldens
    requested = frozenset(parse_frames(frames, job.scene.camera.path.frames))
    picked = [golden for golden in goldens if golden.frame in requested]
    if not picked:
        numbers = _some([golden.frame for golden in goldens])
        raise InputError(
            "no goldens of these frames",
            where="--frames",
            got=frames,
            expected=f"frames listed in {folder / PROVENANCE_FILE}: {numbers}",
        )
    return picked


def _notes(provenance: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[str]:
    if provenance["volume"]["fingerprint"] != now["volume"]["fingerprint"]:
        yield f"another volume: {_volume(now)}; the goldens show {_volume(provenance)}"
    scene = describe_changes(provenance, now, "scene")
    if scene:
        yield f"the scene has changed since the goldens were rendered: {scene}"


def _file_notes(folder: Path, goldens: Sequence[Golden], unlisted: Sequence[str]) -> Iterator[str]:
    """Return notes on missing and changed goldens, and on other pictures."""
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
    """Return driver, volume and common versions, of the goldens and of now."""
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
