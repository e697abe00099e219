"""`hsplat init VOLUME`: a scene file to start from."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click

from hsplat_cli.scenes import (
    FILM_OPTION_NAMES,
    FilmOptions,
    base_name,
    film_options,
    suggest_scene,
    volume_options,
    volume_spec,
)
from hsplat_cli.terminal import OutputPath, Reporter
from renderer.errors import InputError
from renderer.film import require_no_input, require_writable_dry_run, volume_files, write_staged


@click.command()
@click.argument("volume", type=click.Path(path_type=Path))
@click.option("--output", type=OutputPath(), metavar="FILE", help="Write to this file, not to stdout.")
@click.option("--force", is_flag=True, help="Write over a file that is there.")
@film_options
@volume_options(nonfinite=None)
def init(*, volume: Path, output: Path | None, force: bool, colormap: str | None, **options: Any) -> None:
    """Write a scene file for a volume, to start from.

    VOLUME is a file, or a folder of slices. The scene is a turntable with a transfer function that suits the values;
    it goes to the standard output: hsplat init scan.nrrd > scene.yaml
    """
    film = FilmOptions(**{name: options.pop(name) for name in FILM_OPTION_NAMES})
    if output is not None:
        _require_yaml_suffix(output)
    if output is not None and os.path.exists(output) and not force:  # no error for names that cannot be
        raise InputError(
            "there is a file of this name", where=str(output), hint="--force writes over it; --output names another one"
        )
    spec = volume_spec(volume, options)
    if output is not None:  # before the volume is read, as that may take long
        _require_folder(output)
        require_no_input([output], volume_files(spec))
    scene = suggest_scene(
        spec,
        film,
        Reporter(),
        colormap=colormap,
        hides_nonfinite=options["nonfinite"] is None,
        scene=output or Path("scene.yaml"),
        output=Path(f"{base_name(volume)}.mp4"),
    )
    for line in scene.summary_lines():
        click.echo(f"{volume}: {line}", err=True)
    if output is None:
        # As bytes: a terminal's encoding does not concern the file that this may become.
        click.echo(scene.text.encode(), nl=False)
    else:
        write_staged(output, scene.text.encode())
        click.echo(f"{output}: written; `hsplat render {output}` makes the film", err=True)


def _require_yaml_suffix(output: Path) -> None:
    """Raise InputError for a name such as film.mp4, by which the scene would not be found."""
    if output.suffix.lower() not in (".yaml", ".yml"):
        raise InputError(
            "the output of init is a scene",
            where=str(output),
            expected="the name of a .yaml or .yml file",
            hint=f"--output {output.with_suffix('.yaml')}; the film gets its name in it",
        )


def _require_folder(output: Path) -> None:
    """Raise what hinders a file of this name: its folder, too, which is not made for a volume that may not be read."""
    require_writable_dry_run(output)
    if not output.parent.is_dir():
        raise InputError(
            "the folder of the output is not there", where=str(output), got=str(output.parent), hint="make it first"
        )
