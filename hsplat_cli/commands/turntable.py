"""Run `hsplat turntable VOLUME...`: render a film of each volume, without a scene file or with one for all."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import asdict, fields
from pathlib import Path

import click
from click.core import ParameterSource

from hsplat_cli.commands.shared_options import FILE, cache_option, quiet_option, require_none_of
from hsplat_cli.executors import ExecutorSpec, executor_options, require_scheduler
from hsplat_cli.scenes import (
    ReadingOptions,
    SharedLook,
    expand_volumes,
    film_options,
    name_volumes,
    volume_options,
    volume_spec,
)
from hsplat_cli.terminal import OutputPath, Reporter, VolumePath
from hsplat_cli.turntable import (
    FilmRequest,
    Gallery,
    make_film,
    make_requested_films,
    require_harmless,
    require_own_folder,
    run_batch,
)
from renderer.errors import InputError
from renderer.scene import FORMATS
from renderer.suggest import FilmOptions

# The folder of scenes and films where `--output` names none, in the current folder.
_DEFAULT_FOLDER = "films"


@click.command()
@click.argument("volumes", metavar="VOLUME...", nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    "folder",
    type=OutputPath(file_okay=False),
    default=_DEFAULT_FOLDER,
    show_default=True,
    metavar="FOLDER",
    help="Write scenes and films into this folder.",
)
@click.option(
    "--format", "kind", type=click.Choice([suffix[1:] for suffix in FORMATS]), default="mp4", show_default=True
)
@click.option(
    "--scene",
    "look",
    type=FILE,
    metavar="FILE",
    help="Give all volumes the look of this scene: transfer function, light, clip, camera, annotation, outputs.",
)
@click.option(
    "--match",
    "reference",
    type=VolumePath(),
    metavar="FILE",
    help="Match the scene's values, which belong to this volume.",
)
@film_options
@volume_options()
@cache_option
@executor_options
@click.option("--force", is_flag=True, help="Draw again, and overwrite scenes that were edited.")
@quiet_option(help="Print only the table and errors.")
@click.option(
    "--connection",
    type=(int, int),
    hidden=True,
    help="The socket by which a batch asks this process for films, and the number of its processes.",
)
def turntable(
    *,
    volumes: tuple[str, ...],
    folder: Path,
    kind: str,
    look: Path | None,
    reference: Path | str | None,
    film: FilmOptions,
    reading: ReadingOptions,
    executor: ExecutorSpec,
    force: bool,
    reporter: Reporter,
    connection: tuple[int, int] | None,
) -> None:
    """Render turntables of volumes without a scene file.

    Each VOLUME is a file, a folder of slices or of volumes, a pattern such as 'scans/*.nrrd', or the URL of a store.
    FOLDER gets NAME.yaml, a scene with a transfer function that suits the values, to be edited; NAME.mp4;
    turntable.json, which lists the result for each volume; and index.html, which shows all films. Without -o it is
    'films', unless a folder of this name has other files than those of earlier turntables. A volume that fails
    does not stop the others; the exit code is then 1, or 2 if wrong inputs and locked outputs were the only reasons.

    With --scene all films have the look of a scene, each framed on its own. Its values may be percentiles (relative:
    true). With --match its values belong to a reference volume, and are shifted and scaled to each volume by comparing
    histograms.
    """
    require_scheduler(executor.scheduler)
    if film.background == "transparent" and not FORMATS[f".{kind}"].has_alpha:
        hint = f"--format {', '.join(suffix[1:] for suffix, each in FORMATS.items() if each.has_alpha)}"
        raise InputError(f"a transparent background in .{kind}", where="--background", expected="a color", hint=hint)
    numbered = "/{frame:04}" * FORMATS[f".{kind}"].is_frames
    shared = _shared_look(look, reference)
    chosen = {"format": kind} if shared is None else {"scene": look, "match": reference}
    if shared is not None:
        film = FilmOptions(shared.scene.num_frames)
    arguments = [*_as_arguments(_given() | chosen | {"force": force}), f"--output={folder}"]

    def request_of(film_name: str, volume: Path | str) -> FilmRequest:
        problems = list[InputError]()
        return FilmRequest(
            volume=volume_spec(volume, reading, problems),
            film=film,
            scene=folder / f"{film_name}.yaml",
            output=shared.outputs(folder, film_name).file if shared else folder / f"{film_name}{numbered}.{kind}",
            executor=executor,
            force=force,
            command=shlex.join(["hsplat", "turntable", *arguments, "--", str(volume)]),
            look=shared,
            problem=next(iter(problems), None),
        )

    if connection is not None:
        make_requested_films(*connection, request_of, reporter)
        return
    if click.get_current_context().get_parameter_source("folder") is ParameterSource.DEFAULT:
        require_own_folder(folder)
    requests = [request_of(film_name, volume) for film_name, volume in _named_volumes(volumes, reporter).items()]
    require_harmless(requests)
    if len(requests) > 1:
        how = _as_arguments({"quiet": reporter.is_quiet, **asdict(executor)})
        run_batch(requests, [*arguments, *how, "--", *volumes], folder, reporter)
    else:
        make_film(requests[0], reporter)
        Gallery(folder, reporter).finish()


def _shared_look(look: Path | None, reference: Path | str | None) -> SharedLook | None:
    """Return the look that all volumes share, or None. Raises InputError for options that contradict it."""
    if look is None and reference is not None:
        hint = "--scene names a scene with values of this volume"
        raise InputError("needs --scene", where=f"--match {reference}", hint=hint)
    if look is None:
        return None
    require_none_of(["kind", *(field.name for field in fields(FilmOptions))], "the scene says it: change it there")
    return SharedLook.load(look, reference)


def _given() -> dict[str, object]:
    """Return the options on films and on reading volumes that the command line gives, by name, in a fixed order."""
    context = click.get_current_context()
    names = {field.name for cls in (FilmOptions, ReadingOptions) for field in fields(cls)}
    given = {name for name in names if context.get_parameter_source(name) is ParameterSource.COMMANDLINE}
    return {name: value for name, value in context.params.items() if name in given}


def _as_arguments(options: Mapping[str, object]) -> Iterator[str]:
    """Yield parsed options as arguments: `frames=30` becomes `--frames=30`; None and False are left out."""
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        if value is True:
            yield flag
        elif value is not None and value is not False:
            yield f"{flag}={','.join(map(str, value)) if isinstance(value, tuple) else value}"


def _named_volumes(volumes: tuple[str, ...], reporter: Reporter) -> dict[str, Path | str]:
    found, notes = expand_volumes(volumes)
    if not found:
        raise InputError("there is nothing to render", where="hsplat turntable", got=", ".join(volumes))
    for note in notes:
        reporter.status(f"note: {note}")
    return name_volumes(found)
