"""Write the scene of one volume beside its film, and render that scene as `hsplat render` does."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path

from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.scenes import FilmOptions, Job, expand_pattern, suggest_scene, volume_file
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable.manifest import (
    FAILED,
    FINISHED,
    INTERRUPTED,
    LOCK_FILE,
    MANIFEST_FILE,
    NOT_STARTED,
    SHORT_LOCK_TIMEOUT_S,
    STARTED,
    VOLUME_KEY,
    FilmRecord,
    update_manifest,
)
from renderer.errors import HsplatError, InputError, OutputLockedError
from renderer.film import (
    film_files,
    locked_output,
    require_no_input,
    require_writable,
    sidecar_path,
    sidecar_path_of_file,
    translate_os_errors,
    volume_files,
    write_staged,
)
from renderer.scene import OutputSpec, VolumeSpec, parse_scene_content, schedule_to_dict


@dataclass(frozen=True)
class FilmRequest:
    """A film to make. scene: the file for its scene.

    force: an edited scene may be overwritten, and finished frames are drawn again.
    hides_nonfinite: as for `suggest_scene`.
    """

    volume: VolumeSpec
    film: FilmOptions
    colormap: str | None
    scene: Path
    output: Path
    executor: ExecutorSpec
    force: bool
    hides_nonfinite: bool = False

    def record(self, status: str) -> FilmRecord:
        """Return what the record of the film has in any case."""
        paths = {"record_paths": False} if self.film.no_paths else {}
        return paths | {
            "volume": str(volume_file(self.volume)),
            "scene": str(self.scene),
            "film": str(self.output),
            "status": status,
            VOLUME_KEY: self.volume_path,
        }

    @property
    def volume_path(self) -> str:
        """Return the path of the volume, relative to the folder and without links."""
        return os.path.relpath(os.path.realpath(volume_file(self.volume)), os.path.realpath(self.scene.parent))

    def output_files(self) -> Iterator[Path]:
        """Yield all files that making the film may replace or remove."""
        frames = range(self.film.frames)
        yield from (self.scene.parent / name for name in (self.scene.name, MANIFEST_FILE, LOCK_FILE))
        yield from film_files(OutputSpec(self.output), frames, sidecar_path_of_file(self.output, frames, len(frames)))

    def failure_record(self, error: HsplatError) -> FilmRecord:
        """Return the record of a film that failed, or that another job is making. Exit code 2 is for wrong input."""
        status = NOT_STARTED if isinstance(error, OutputLockedError) else FAILED
        summary = {"summary": error.summary} if self.film.no_paths else {}
        exit_code = 2 if isinstance(error, InputError) else 1
        return self.record(status) | {"exit_code": exit_code, "error": str(error)} | summary


def require_inputs_kept(requests: Sequence[FilmRequest]) -> None:
    """Raise InputError if an output of one of the films is a file of one of the volumes."""
    outputs = chain.from_iterable(request.output_files() for request in requests)
    require_no_input(outputs, chain.from_iterable(volume_files(request.volume) for request in requests))


def make_film(request: FilmRequest, reporter: Reporter) -> FilmRecord:
    """Make the film, record in turntable.json what became of it, and return that record. Raises HsplatError.

    A failure leaves no folder, and no record, where there was no folder before.
    """
    folder = request.scene.parent
    missing_folders = [each for each in (folder, *folder.parents) if not os.path.exists(each)]
    try:
        record = _make_film(request, reporter)
    except (HsplatError, KeyboardInterrupt) as error:
        failure = request.failure_record(error) if isinstance(error, HsplatError) else request.record(INTERRUPTED)
        for each in missing_folders:
            with suppress(OSError):  # not empty
                each.rmdir()
        with suppress(HsplatError):  # the first error is the one to report
            if os.path.isdir(folder):
                update_manifest(folder, [failure], SHORT_LOCK_TIMEOUT_S)
        raise
    update_manifest(folder, [record])
    return record


def _make_film(request: FilmRequest, reporter: Reporter) -> FilmRecord:
    """Write the scene, render it, and return the record of the film. Raises HsplatError."""
    volume = volume_file(request.volume)
    expand_pattern(str(volume))  # raises where no file matches
    # Before the volume is read, which may take long.
    require_writable(request.scene)
    suggested = suggest_scene(
        request.volume,
        request.film,
        reporter,
        colormap=request.colormap,
        scene=request.scene,
        output=request.output,
        hides_nonfinite=request.hides_nonfinite,
    )
    for line in (f"{suggested.kind}; {suggested.reason}", *suggested.notes):
        reporter.status(f"{volume}: {line}")
    content = marked_scene(suggested.text, request.volume_path)
    _require_replaceable(request, content)
    scene = parse_scene_content(content, request.scene)  # before the file exists: no change to it affects the job
    job = Job(scene, range(scene.camera.path.frames), schedule_to_dict(scene.error))
    sidecar = sidecar_path(job.scene, job.frames)
    # Locked from before the scene is written until the film is finished, because they belong together.
    with locked_output(job.scene.output, job.frames, sidecar) as work_folder:
        write_scene(request, content)
        reporter.announce_compilation()
        # Imported here to keep --help fast.
        from hsplat_cli.films import render_film

        on_start = partial(update_manifest, request.scene.parent, [request.record(STARTED)])
        film = render_film(
            job, request.executor, reporter, work_folder=work_folder, on_start=on_start, force=request.force
        )
    if film.shortfall is not None:
        raise film.shortfall
    frames, seconds = film.record["frames"], film.record["seconds"]["total"]
    return request.record(FINISHED) | {
        "kind": suggested.kind,
        "reason": suggested.reason,
        "frames": len(frames),
        "splats": round(sum(frame["splats"] for frame in frames) / len(frames)),
        "seconds": round(seconds, 3),
    }


def write_scene(request: FilmRequest, content: bytes) -> None:
    """Write the scene's file, and record that its film is started, unless the file has this content.

    Raises InputError where the file is a scene that somebody edited, or that of another volume, unless with `force`.
    """
    if not _require_replaceable(request, content):
        update_manifest(request.scene.parent, [request.record(STARTED)])
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


def marked_scene(text: str, volume_path: str) -> bytes:
    """Return a scene with a last line that shows whose it is, and that nobody has edited it."""
    from renderer.film import bytes_digest

    volume = json.dumps(volume_path)
    marked = f"{text}\n# `hsplat turntable` replaces this file while nobody has changed it; of {volume}: "
    return f"{marked}{bytes_digest(marked.encode())}\n".encode()


def _volume_of_unedited(content: bytes) -> str | None:
    """Return the volume path in a marked scene that nobody has edited."""
    from renderer.film import bytes_digest

    found = re.fullmatch(rb'(.*; of ("[^\n]*"): )([0-9a-f]{32})\n', content, re.DOTALL)
    return json.loads(found[2]) if found and bytes_digest(found[1]).encode() == found[3] else None


def print_film_record(request: FilmRequest, reporter: Reporter) -> None:
    """Make the film on behalf of a batch, and print its record as a last line of JSON, also if it failed."""
    try:
        record = make_film(request, reporter)
    except HsplatError as error:
        record = request.failure_record(error)
    reporter.result(json.dumps(record))
