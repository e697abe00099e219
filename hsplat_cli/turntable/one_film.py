"""Write the scene of one volume beside its film, and render that scene as `hsplat render` does."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.scenes import SharedLook, suggest_scene, volume_file
from hsplat_cli.terminal import FilmEvents, Reporter, report_film
from hsplat_cli.turntable import manifest
from hsplat_cli.turntable.gallery import CONTACT_FILE, PAGE_FILE, poster_file
from hsplat_cli.turntable.manifest import FilmEntry, update_manifest
from hsplat_cli.turntable.up_to_date import made_by, marks_of
from renderer.errors import HsplatError, InputError, OutputLockedError
from renderer.film import (
    WrittenFiles,
    bytes_digest,
    film_files,
    require_writable,
    sidecar_path_of_file,
    translate_os_errors,
    write_staged,
)
from renderer.job import FilmJob, expand_pattern, scene_files, volume_files
from renderer.scene import (
    ColormapSpec,
    FilmScene,
    LabelsSpec,
    OutputSpec,
    VolumeSpec,
    accuracy_of,
    file_source,
    join_some,
    parse_scene_content,
    relative_path,
)
from renderer.suggest import FilmOptions

if TYPE_CHECKING:
    from renderer.suggest import Suggestion

_FOLDER_FILES = (manifest.MANIFEST_FILE, manifest.LOCK_FILE, PAGE_FILE, CONTACT_FILE)


@dataclass(frozen=True)
class FilmRequest:
    """A film to make. scene: the file for its scene. look: whose it has, unless one is suggested.

    force: an edited scene may be overwritten, and finished frames are drawn again. command: what makes this film alone.
    problem: why there is no film, where that is known before the volume is read.
    """

    volume: VolumeSpec
    film: FilmOptions
    scene: Path
    output: Path
    executor: ExecutorSpec
    force: bool
    command: str = ""
    look: SharedLook | None = None
    problem: InputError | None = None

    @property
    def outputs(self) -> OutputSpec:
        """Return all outputs."""
        return self.look.outputs(self.scene.parent, self.scene.stem) if self.look else OutputSpec(self.output)

    def record(self, status: str) -> FilmEntry:
        """Return what the record of the film has in any case; its paths are relative to the folder."""
        folder = self.scene.parent
        return {
            "volume": relative_path(volume_file(self.volume), folder),
            "scene": self.scene.name,
            "film": relative_path(self.output, folder),
            "status": status,
        }

    @property
    def volume_path(self) -> str:
        """Return the path of the volume, relative to the folder and without links."""
        return os.path.relpath(os.path.realpath(volume_file(self.volume)), os.path.realpath(self.scene.parent))

    @property
    def wish(self) -> str:
        """Return all that is wished of the film, whatever is there already."""
        return repr(replace(self, force=False, command=""))

    def input_files(self) -> Iterator[Path]:
        """Yield all files that the film is made from."""
        for volume in filter(None, (self.volume, self.film.under)):
            yield from volume_files(volume)
            if ".ome." in (file := volume_file(volume)).name:  # which may name others beside it
                yield from sorted(file.parent.glob("*.ome.*"))
        if self.film.preset is not None:
            yield Path(self.film.preset.partition("#")[0])
        yield from _look_files(self.look)

    @property
    def film_files(self) -> WrittenFiles:
        """Return the scene, the film, its sidecar and unfinished work."""
        frames = range(self.look.scene.num_frames if self.look else self.film.frames)
        sidecar = sidecar_path_of_file(self.output, frames, len(frames))
        return WrittenFiles([self.scene]) + film_files(self.outputs, frames, sidecar)

    def failure_record(self, error: HsplatError) -> FilmEntry:
        """Return the record of a film that failed, or that another job is making. Exit code 2 is for wrong input."""
        status = manifest.NOT_STARTED if isinstance(error, OutputLockedError) else manifest.FAILED
        exit_code = 2 if isinstance(error, InputError) else 1
        return self.record(status) | {"exit_code": exit_code, "error": str(error), "command": self.command}


def require_harmless(requests: Sequence[FilmRequest]) -> None:
    """Raise InputError if an output of one of the films is a file of a volume or a look, or another output."""
    folder = requests[0].scene.parent
    posters = [poster_file(folder, request.scene.stem) for request in requests]
    written = WrittenFiles([*(folder / name for name in _FOLDER_FILES), *posters])
    for request in requests:
        written += request.film_files
    volumes = {each for request in requests for each in (request.volume, request.film.under) if each is not None}
    written.require_harmless(chain(_look_files(requests[0].look), *map(volume_files, volumes)))


def _look_files(look: SharedLook | None) -> Iterator[Path]:
    if look is not None:
        yield from (look.path, *scene_files(look.scene))
        yield from volume_files(VolumeSpec(file_source(look.reference))) if look.reference is not None else ()


def make_film(request: FilmRequest, reporter: Reporter) -> FilmEntry:
    """Make the film, record in turntable.json what became of it, and return that record. Raises HsplatError.

    A failure leaves no folder, and no record, where there was no folder before.
    """
    folder = request.scene.parent
    missing_folders = [each for each in (folder, *folder.parents) if not os.path.exists(each)]
    try:
        record = _make_film(request, reporter)
    except (HsplatError, KeyboardInterrupt) as error:
        if isinstance(error, HsplatError):
            failure = request.failure_record(error)
        else:
            failure = request.record(manifest.INTERRUPTED)
        for each in missing_folders:
            with suppress(OSError):  # not empty
                each.rmdir()
        if os.path.isdir(folder):
            manifest.try_to_update(folder, [failure], reporter)
        raise
    update_manifest(folder, [record], reporter)
    return record


def _make_film(request: FilmRequest, reporter: Reporter) -> FilmEntry:
    """Write the scene, render it, and return the record of the film. Raises HsplatError."""
    if request.problem is not None:
        raise request.problem
    expand_pattern(str(volume_file(request.volume)))  # raises where no file matches
    inputs = marks_of(request.input_files())
    # Before the volume is read, which may take long.
    require_writable(request.scene)
    text, facts, notes = _scene_text(request, reporter)
    content = marked_scene(text, request.volume_path)
    _require_replaceable(request, content)
    # Imported here to keep --help fast.
    from hsplat_cli.executors import open_executor
    from renderer.readers import read_volume
    from renderer.resolve import resolve_scene

    with request.look.located() if request.look else nullcontext():
        scene = parse_scene_content(content, request.scene)  # before the file exists: no change to it affects the job
        scene = resolve_scene(scene, read_volume)  # of steps in time, and percentiles
    from renderer.job import make_film as draw_film, one_pass
    from renderer.record import round_decibels, round_seconds, visibility_text

    job = FilmJob(scene, range(scene.num_frames), accuracy_of(scene.error))
    open_this = partial(open_executor, request.executor, reporter)
    with _TurntableEvents(reporter, request, content, scene.primitive_name) as events:
        result = draw_film(job, open_this, one_pass, events, resumes=not request.force)
    report_film(result, reporter)
    if result.shortfall is not None:
        raise result.shortfall
    made = result.film.record
    frames, accuracy, visibility = made.frames, made.accuracy, made.visibility
    record = request.record(manifest.FINISHED)
    if made.fingerprint is not None:  # else the next job makes it again
        record["made_by"] = made_by(request, inputs)
    if accuracy is not None:
        record |= {"psnr": round_decibels(accuracy.psnr), "psnr_interval": list(accuracy.interval)}
        record["file_psnr"] = round_decibels((accuracy.file or accuracy).psnr)
    before = manifest.read_films(request.scene.parent).get(request.scene.name, {})
    seen = ", ".join(each.word for each in result.glances if each.word) if result.summary else before.get("seen", "")
    return record | {
        **facts,
        **({"seen": seen} if seen else {}),
        "values": facts.get("values", _visible_values(scene)),
        "hidden": "" if visibility is None else visibility_text(visibility),
        "notes": [*made.notes, *notes],
        "frames": len(frames),
        "primitives": round(sum(frame.primitives for frame in frames) / len(frames)),
        "seconds": round_seconds(made.seconds["total"]),
    }


def _scene_text(request: FilmRequest, reporter: Reporter) -> tuple[str, FilmEntry, Sequence[str]]:
    """Return the scene, what it tells of the film's record, and notes. Raises HsplatError."""
    if request.look is not None:
        text, notes = request.look.scene_text(request.volume, request.scene, reporter)
        return text, {"kind": request.look.path.name, "reason": ""}, notes
    text, found = suggest_scene(request.volume, request.film, reporter, scene=request.scene, output=request.output)
    chosen = found.suggestion
    facts = {"kind": chosen.kind, "reason": chosen.reason, "values": _shown_values(chosen)}
    return text, facts, chosen.outlier_notes


def _visible_values(scene: FilmScene) -> str:
    """Return the ends of the visible values of the first volume, such as `18.9 to 255`; of labels their names."""
    transfer = scene.at(0).layers[0].transfer_function
    if transfer.labels is not None:
        return _label_names(transfer.labels)
    pairs = [(point.value, point.opacity) for point in transfer.points]
    if isinstance(transfer.mapping, ColormapSpec):
        pairs = [*transfer.mapping.opacity]
    ends = [value for pair in pairwise(pairs) if pair[0][1] or pair[1][1] for value, _ in pair]
    return f"{min(ends):g} to {max(ends):g}" if ends else ""


def _shown_values(suggestion: Suggestion) -> str:
    """Return `18.9 to 255`, or the names of labels; empty where it is not known which values are shown."""
    if (labels := suggestion.transfer.labels) is not None:
        return _label_names(labels)
    ends = [end for layer in suggestion.visible for each in layer.ranges for end in each]
    return f"{min(ends):g} to {max(ends):g}" if ends else ""


def _label_names(labels: LabelsSpec) -> str:
    """Return `caudate, putamen and 14 more`, with numbers of labels that have no name."""
    return join_some([style.name or f"label {style.value}" for style in labels.styles])


class _TurntableEvents(FilmEvents):
    """A listener that also writes the scene, and records in turntable.json that a film is started."""

    def __init__(self, reporter: Reporter, request: FilmRequest, content: bytes, noun: str) -> None:
        super().__init__(reporter, noun)
        self._request, self._content = request, content

    def locked(self) -> None:
        """Write the scene: it belongs to the film, and no other job may change it before the film is finished."""
        write_scene(self._request, self._content, self._reporter)

    def volume_noted(self, text: str) -> None:
        """Print nothing where this was printed when the scene was suggested."""
        if self._request.look is not None:
            super().volume_noted(text)

    def prepared(self) -> None:
        """Record the film; one that is up to date is not started."""
        update_manifest(self._request.scene.parent, [self._request.record(manifest.STARTED)], self._reporter)


def write_scene(request: FilmRequest, content: bytes, reporter: Reporter) -> None:
    """Write the scene's file, and record that its film is started, unless the file has this content.

    Raises InputError where the file is a scene that somebody edited, or that of another volume, unless with `force`.
    """
    if not _require_replaceable(request, content):
        update_manifest(request.scene.parent, [request.record(manifest.STARTED)], reporter)
        write_staged(request.scene, content)


def _require_replaceable(request: FilmRequest, content: bytes) -> bool:
    """Return whether the scene's file has this content; raises as `write_scene`."""
    scene = request.scene
    with translate_os_errors(scene):
        existing = scene.read_bytes() if scene.exists() else None
    if existing is None or existing == content or request.force:
        return existing == content
    volume = _volume_of_unedited(existing)
    if volume is None:
        raise InputError(
            "another scene of this name exists, perhaps one that was edited",
            where=str(scene),
            hint=f"`hsplat render {scene}` renders it; --force overwrites it",
        )
    if volume != request.volume_path:
        raise InputError(
            "a film of another volume has this name",
            where=str(scene),
            got=f"that of {os.path.relpath(os.path.join(os.path.realpath(scene.parent), volume))}",
            hint="give this one another --output, or both to one command, which gives them different names; "
            "--force overwrites it",
        )
    return False


# Behind it a marked scene has the path of its volume, as JSON.
_MARK = b'; of "'


def marked_scene(text: str, volume_path: str) -> bytes:
    """Return a scene with a last line that shows whose it is, and that nobody has edited it."""
    volume = json.dumps(volume_path)
    marked = f"{text}\n# `hsplat turntable` replaces this file while nobody has changed it; of {volume}: "
    return f"{marked}{bytes_digest(marked.encode())}\n".encode()


def _volume_of_unedited(content: bytes) -> str | None:
    """Return the volume path in a marked scene that nobody has edited."""
    before, mark, digest = content.rpartition(b": ")
    is_unedited = bytes_digest(before + mark).encode() + b"\n" == digest
    return json.loads(before[before.rindex(_MARK) + len(_MARK) - 1 :]) if is_unedited and _MARK in before else None


def print_film_record(request: FilmRequest, reporter: Reporter) -> None:
    """Make the film on behalf of a batch, and print its record as a last line of JSON, also if it failed."""
    try:
        record = make_film(request, reporter)
    except HsplatError as error:
        record = request.failure_record(error)
    reporter.result(json.dumps(record))
