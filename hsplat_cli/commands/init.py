"""Run `hsplat init VOLUME`: write a scene file to start from."""

from __future__ import annotations

import os
from itertools import chain
from pathlib import Path

import click

from hsplat_cli.commands.shared_options import cache_option
from hsplat_cli.scenes import (
    SCHEMA_FILE,
    SCHEMA_LINE,
    ReadingOptions,
    SceneRequest,
    base_name,
    film_options,
    load_job,
    suggest_scene,
    volume_options,
    volume_spec,
    write_schema,
)
from hsplat_cli.terminal import OutputPath, Reporter, VolumePath
from renderer.errors import HsplatError, InputError
from renderer.film import WrittenFiles, require_writable_dry_run, write_staged
from renderer.job import volume_files
from renderer.suggest import FilmOptions
from renderer.system import num_cores


@click.command()
@click.argument("volume", type=VolumePath())
@click.option(
    "--output", type=OutputPath(dir_okay=False), metavar="FILE", help="Write to this file, not to the standard output."
)
@click.option("--force", is_flag=True, help="Overwrite an existing file.")
@film_options
@volume_options()
@cache_option
def init(*, volume: Path | str, output: Path | None, force: bool, film: FilmOptions, reading: ReadingOptions) -> None:
    """Write a scene file for a volume, to start from.

    VOLUME is a file, a folder of slices, or a store, also at a URL. The scene is a turntable with a transfer function
    that suits the values; it goes to the standard output: hsplat init scan.nrrd > scene.yaml
    """
    reporter = Reporter()
    click.get_current_context().with_resource(reporter.passes())
    spec = volume_spec(volume, reading)
    if output is not None:  # checked before the volume is read, which may take long
        _require_output(output, force=force)
        volumes = filter(None, (spec, film.under))
        written = WrittenFiles([output, output.with_name(SCHEMA_FILE)])
        written.require_harmless(chain.from_iterable(map(volume_files, volumes)))
    scene, film_file = output or Path("scene.yaml"), Path(f"{base_name(volume)}.mp4")
    text, _ = suggest_scene(spec, film, reporter, scene=scene, output=film_file)
    _tell_faults(SceneRequest(scene, content=text.encode()), reporter)
    if output is None:
        reporter.content(text.encode())
        if isinstance(volume, Path) and not volume.is_absolute():
            reporter.status("paths of this scene are relative to this folder; --output FILE writes it into another one")
    else:
        write_schema(output.with_name(SCHEMA_FILE))
        write_staged(output, f"{SCHEMA_LINE}{text}".encode())
        reporter.status(f"{output}: written; `hsplat render {output}` makes the film")


def _tell_faults(request: SceneRequest, reporter: Reporter) -> None:
    """Print a warning for each fault of the pictures of a suggested scene; the scene is written in any case."""
    # Imported here: the module loads kernels.
    from renderer.accuracy import look_at_scene

    try:
        job = load_job(request, "nothing")
        glances = look_at_scene(job.scene, job.frames, num_threads=num_cores())
    except HsplatError as error:
        reporter.warning(f"warning: the film was not looked at: {error.summary}")
        return
    for each in glances:
        reporter.warning(f"warning: {each.note}")


def _require_output(output: Path, *, force: bool) -> None:
    """Raise InputError unless a scene can be written here; a missing folder is an error, and is not made."""
    if output.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(
            "the output of init is a scene",
            where=str(output),
            expected="the name of a .yaml or .yml file",
            hint=f"--output {output.with_suffix('.yaml')}; the film gets its name in it",
        )
    if os.path.exists(output) and not force:  # unlike Path.exists, no error for impossible names
        raise InputError(
            "this file exists", where=str(output), hint="--force overwrites it; --output names another one"
        )
    require_writable_dry_run(output)
    if not output.parent.is_dir():
        raise InputError(
            "the folder of the output does not exist", where=str(output), got=str(output.parent), hint="make it first"
        )
