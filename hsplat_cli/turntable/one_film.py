"""One volume: its scene, written beside its film, and the film, made from that scene as `hsplat render` does it."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.scenes import FilmOptions, Job, SuggestedScene, expand_pattern, suggest_scene, volume_file
from hsplat_cli.terminal import Reporter, report_first_run
from hsplat_cli.turntable.manifest import (
    DONE,
    NOT_STARTED,
    OF,
    STARTED,
    Record,
    Report,
    Written,
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
    from hsplat_cli.films import Film

_MAX_NUMBER = 2**53  # of splats or seconds; larger ones are mistakes


@dataclass(frozen=True)
class Order:
    """A film to be made. scene: the file that it is described in.

    force: an edited scene there may be lost, and what was drawn is drawn again.
    hides_nonfinite: as `suggest_scene` takes it.
    """

    volume: VolumeSpec
    film: FilmOptions
    colormap: str | None
    scene: Path
    output: Path
    executor: ExecutorSpec
    force: bool
    hides_nonfinite: bool = False

    def record(self, status: str) -> Record:
        """What the report says about it in any case."""
        return {
            "volume": str(volume_file(self.volume)),
            "scene": str(self.scene),
            "film": str(self.output),
            "status": status,
            OF: self.of,
        }

    @property
    def of(self) -> str:
        """The volume as a scene is known to be of it: relative to the folder, without links."""
        return os.path.relpath(os.path.realpath(volume_file(self.volume)), os.path.realpath(self.scene.parent))

    def failed(self, error: HsplatError) -> Record:
        """The record of a film that could not be made, or that another job is making."""
        status = NOT_STARTED if isinstance(error, OutputLockedError) else "failed"
        return self.record(status) | {"exit_code": exit_code(error), "error": str(error)}


def exit_code(error: HsplatError) -> int:
    """2 where the input was wrong, else 1."""
    return 2 if isinstance(error, InputError) else 1


def make_film(order: Order, *, quiet: bool) -> Record:
    """Write the scene, render it, and say what came of it. Raises HsplatError."""
    expand_pattern(str(volume_file(order.volume)))  # or there is none
    # Before the volume is read, as that may take long.
    require_writable(order.scene)
    suggested = suggest_scene(
        order.volume,
        order.film,
        Reporter(quiet),
        colormap=order.colormap,
        scene=order.scene,
        output=order.output,
        hides_nonfinite=order.hides_nonfinite,
    )
    if not quiet:
        for line in suggested.summary_lines():
            click.echo(f"{volume_file(order.volume)}: {line}", err=True)
    require_unedited_scene(order, suggested)
    job = _job(order, suggested)
    # Held from before the scene is written until the film is there: they belong together.
    sidecar = sidecar_path(job.scene, job.frames)
    require_no_input([order.scene, *picture_files(job.scene.output, job.frames), sidecar], volume_files(order.volume))
    with locked_output(job.scene.output, job.frames, sidecar) as place:
        write_scene(order, suggested)
        report_first_run(quiet=quiet)
        # Imported here: numba and GL take longer to load than --help may take to answer.
        from hsplat_cli.films import render_film

        tell = partial(update_manifest, order.scene.parent, [order.record(STARTED)])
        film = render_film(job, order.executor, Reporter(quiet), work_folder=place, on_start=tell, force=order.force)
    if film.shortfall is not None:
        raise film.shortfall
    return order.record(DONE) | {"kind": suggested.kind, "reason": suggested.reason} | film_statistics(film)


def _job(order: Order, suggested: SuggestedScene) -> Job:
    """What the scene's text asks for, whatever becomes of its file meanwhile."""
    content = suggested.text.encode()
    scene = parse_scene_content(content, order.scene, overrides=(), volume=None, output=None, is_single_frame=False)
    return Job(scene, range(scene.camera.path.frames), schedule_to_dict(scene.error))


def write_scene(order: Order, suggested: SuggestedScene) -> None:
    """Write the scene's file, and into the report that the film is begun, unless that of the same scene is done.

    Raises InputError where there is a scene already that this program did not write like that, or of another volume.
    """
    from renderer.film import bytes_digest

    content = suggested.text.encode()
    with open_manifest(order.scene.parent) as report:
        there = _there(order.scene)
        digests = [bytes_digest(content)]
        if there is not None and there != content:
            if not order.force:
                _require_unedited(order.scene, bytes_digest(there), order.of, report)
            written = report.written(order.scene)
            digests += [bytes_digest(there)] if written is not None and bytes_digest(there) in written.digests else []
        former = report.told(order.scene) if there == content else None
        record = former if former is not None and former["status"] == DONE else order.record(STARTED)
        # First, and with both: when this process is killed, whichever of them is there is known.
        report.put(record | Written(order.of, digests).as_record())
        if there != content:
            write_staged(order.scene, content)


def require_unedited_scene(order: Order, suggested: SuggestedScene) -> None:
    """Raise what `write_scene` would about a scene that is there, before anything is made for the film."""
    from renderer.film import bytes_digest

    there = _there(order.scene)
    if there is not None and there != suggested.text.encode() and not order.force:
        _require_unedited(order.scene, bytes_digest(there), order.of, Report(order.scene.parent))


def _there(scene: Path) -> bytes | None:
    with translate_os_errors(scene):
        return scene.read_bytes() if scene.exists() else None


def _require_unedited(scene: Path, digest: str, of: str, report: Report) -> None:
    """Raise InputError unless a scene is as it was written, and for the same volume, or else another film is lost."""
    written = report.written(scene)
    if written is None or digest not in written.digests:
        raise InputError(
            "there is another scene of this name, perhaps one that was changed by hand",
            where=str(scene),
            hint=f"`hsplat render {scene}` renders it as it is; --force writes over it",
        )
    if written.of != of:
        raise InputError(
            "there is a film of another volume of this name",
            where=str(scene),
            got=f"that of {os.path.relpath(os.path.join(os.path.realpath(scene.parent), written.of))}",
            hint="give this one another --output, or both to one command, which names them apart; "
            "--force writes over it",
        )


def film_statistics(film: Film) -> Record:
    """Return the frames, the mean number of bricks (as `splats`) and the seconds of a film.

    The sidecar of a film that was up to date may have been edited: numbers that cannot be are left out.
    """
    mean = Fraction(sum(frame["splats"] for frame in film.frames), len(film.frames))
    statistics: Record = {"frames": len(film.frames)} | ({"splats": round(mean)} if mean < _MAX_NUMBER else {})
    seconds = film.record.get("seconds")
    total = seconds.get("total") if isinstance(seconds, dict) else None
    if isinstance(total, (int, float)) and 0 <= total < _MAX_NUMBER:
        statistics["seconds"] = round(total, 3)
    return statistics


def print_film_record(order: Order, *, quiet: bool) -> None:
    """Make the film on behalf of a batch, and print its record as a last line of JSON, also where it failed."""
    try:
        record = make_film(order, quiet=quiet)
    except HsplatError as error:
        record = order.failed(error)
    click.echo(json.dumps(record))
