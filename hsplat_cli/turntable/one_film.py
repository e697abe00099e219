"""One volume: write its scene beside its film, and render that scene as `hsplat render` does."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.scenes import FilmOptions, Job, SuggestedScene, expand_pattern, suggest_scene, volume_file
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable.manifest import (
    DIGESTS_KEY,
    FINISHED,
    NOT_STARTED,
    STARTED,
    VOLUME_KEY,
    FilmRecord,
    Manifest,
    open_manifest,
    update_manifest,
)
from renderer.errors import HsplatError, InputError, OutputLockedError
from renderer.film import (
    locked_output,
    picture_files,
    require_no_input,
    require_writable,
    sidecar_path,
    translate_os_errors,
    volume_files,
    write_staged,
)
from renderer.scene import VolumeSpec, parse_scene_content, schedule_to_dict

if TYPE_CHECKING:
    from hsplat_cli.films import FilmResult

_MAX_NUMBER = 2**53  # of splats or seconds; larger ones are mistakes


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
        return {
            "volume": str(volume_file(self.volume)),
            "scene": str(self.scene),
            "film": str(self.output),
            "status": status,
            VOLUME_KEY: self.volume_path,
        }

    @property
    def volume_path(self) -> str:
        """The path of the volume, relative to the folder and without links."""
        return os.path.relpath(os.path.realpath(volume_file(self.volume)), os.path.realpath(self.scene.parent))

    def failure_record(self, error: HsplatError) -> FilmRecord:
        """Return the record of a film that failed, or that another job is making. Exit code 2 is for wrong input."""
        status = NOT_STARTED if isinstance(error, OutputLockedError) else "failed"
        return self.record(status) | {"exit_code": 2 if isinstance(error, InputError) else 1, "error": str(error)}


def make_film(request: FilmRequest, reporter: Reporter) -> FilmRecord:
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
    content = suggested.text.encode()
    _read_existing(request, content, Manifest(request.scene.parent))
    job = _parse_job(request, content)
    sidecar = sidecar_path(job.scene, job.frames)
    outputs = [request.scene, *picture_files(job.scene.output, job.frames), sidecar]
    require_no_input(outputs, volume_files(request.volume))
    # Locked from before the scene is written until the film is finished, because they belong together.
    with locked_output(job.scene.output, job.frames, sidecar) as work_folder:
        write_scene(request, suggested)
        reporter.announce_compilation()
        # Imported here to keep --help fast.
        from hsplat_cli.films import render_film

        on_start = partial(update_manifest, request.scene.parent, [request.record(STARTED)])
        film = render_film(
            job, request.executor, reporter, work_folder=work_folder, on_start=on_start, force=request.force
        )
    if film.shortfall is not None:
        raise film.shortfall
    return request.record(FINISHED) | {"kind": suggested.kind, "reason": suggested.reason} | film_statistics(film)


def _parse_job(request: FilmRequest, content: bytes) -> Job:
    """Return the job of the scene's text, which no change to its file affects."""
    scene = parse_scene_content(content, request.scene)
    return Job(scene, range(scene.camera.path.frames), schedule_to_dict(scene.error))


def write_scene(request: FilmRequest, suggested: SuggestedScene) -> None:
    """Write the scene's file, and record that the film is started unless the film of the same scene is finished.

    Raises InputError where the file is a scene that somebody edited, or that of another volume.
    """
    from renderer.film import bytes_digest

    content = suggested.text.encode()
    with open_manifest(request.scene.parent) as manifest:
        existing = _read_existing(request, content, manifest)
        digests, record = [bytes_digest(content)], request.record(STARTED)
        if existing == content:
            former = manifest.record_of(request.scene)
            record = former if former.get("status") == FINISHED else record
        elif existing is not None:
            known = manifest.record_of(request.scene).get(DIGESTS_KEY, [])
            digests += [digest for digest in [bytes_digest(existing)] if digest in known]
        # Written first, with both digests: if this process is killed, either file is known.
        manifest.update(record | {VOLUME_KEY: request.volume_path, DIGESTS_KEY: digests})
        if existing != content:
            write_staged(request.scene, content)


def _read_existing(request: FilmRequest, content: bytes, manifest: Manifest) -> bytes | None:
    """Return the scene that exists, or None.

    Raises InputError where it is not `content` and was edited or belongs to another volume, unless with `force`.
    """
    from renderer.film import bytes_digest

    scene = request.scene
    with translate_os_errors(scene):
        existing = scene.read_bytes() if scene.exists() else None
    if existing is None or existing == content or request.force:
        return existing
    record = manifest.record_of(scene)
    if bytes_digest(existing) not in record.get(DIGESTS_KEY, []):
        raise InputError(
            "another scene of this name exists, perhaps one that was edited",
            where=str(scene),
            hint=f"`hsplat render {scene}` renders it; --force overwrites it",
        )
    if record[VOLUME_KEY] != request.volume_path:
        raise InputError(
            "a film of another volume has this name",
            where=str(scene),
            got=f"that of {os.path.relpath(os.path.join(os.path.realpath(scene.parent), record[VOLUME_KEY]))}",
            hint="give this one another --output, or both to one command, which gives them different names; "
            "--force overwrites it",
        )
    return existing


def film_statistics(film: FilmResult) -> FilmRecord:
    """Return the frames, the mean number of bricks (as `splats`) and the seconds of a film.

    The sidecar of a film that was up to date may have been edited: numbers that cannot be are left out.
    """
    mean = Fraction(sum(frame["splats"] for frame in film.frames), len(film.frames))
    statistics: FilmRecord = {"frames": len(film.frames)} | ({"splats": round(mean)} if mean < _MAX_NUMBER else {})
    seconds = film.record.get("seconds")
    total = seconds.get("total") if isinstance(seconds, dict) else None
    if isinstance(total, (int, float)) and 0 <= total < _MAX_NUMBER:
        statistics["seconds"] = round(total, 3)
    return statistics


def print_film_record(request: FilmRequest, reporter: Reporter) -> None:
    """Make the film on behalf of a batch, and print its record as a last line of JSON, also if it failed."""
    try:
        record = make_film(request, reporter)
    except HsplatError as error:
        record = request.failure_record(error)
    reporter.result(json.dumps(record))
