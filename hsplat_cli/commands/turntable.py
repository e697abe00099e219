"""`hsplat turntable VOLUME...`: films without a scene file, one for each volume."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import click

from hsplat_cli.executors import ExecutorSpec, executor_options, require_executor
from hsplat_cli.scenes import (
    FILM_OPTION_NAMES,
    FilmOptions,
    NamedVolume,
    default_output,
    expand_volumes,
    film_options,
    name_volumes,
    require_colormap,
    volume_options,
    volume_spec,
)
from hsplat_cli.terminal import OutputPath, sigterm_as_interrupt
from hsplat_cli.turntable import (
    INTERRUPTED,
    SHORT_LOCK_TIMEOUT_S,
    Order,
    make_film,
    print_film_record,
    run_batch,
    update_manifest,
)
from renderer.errors import HsplatError, InputError


@click.command()
@click.argument("volumes", metavar="VOLUME...", nargs=-1, required=True)
@click.option(
    "-o",
    "--output",
    "folder",
    type=OutputPath(file_okay=False),
    required=True,
    metavar="FOLDER",
    help="Where scenes and films go.",
)
@click.option("--format", "kind", type=click.Choice(["mp4", "gif", "png"]), default="mp4", show_default=True)
@film_options
@volume_options(nonfinite=None)
@executor_options
@click.option("--force", is_flag=True, help="Draw again, over scenes that were changed by hand, too.")
@click.option("--quiet", is_flag=True, help="Say nothing but the table and errors.")
@click.option("--name", hidden=True, help="Of the one volume's film, which another process has settled.")
def turntable(
    *,
    volumes: tuple[str, ...],
    folder: Path,
    kind: Literal["mp4", "gif", "png"],
    colormap: str | None,
    workers: int | None,
    scheduler: str | None,
    force: bool,
    quiet: bool,
    name: str | None,
    **options: Any,
) -> None:
    """Render turntables of volumes without a scene file.

    Each VOLUME is a file, a folder of slices, or a pattern such as 'scans/*.nrrd'. FOLDER gets NAME.yaml, a scene with
    a transfer function that suits the values, to be changed by hand; NAME.mp4; and turntable.json, which says what
    became of each. One that fails does not stop the others, and makes the exit code 1.
    """
    require_colormap(colormap)
    executor = ExecutorSpec(workers, scheduler)
    require_executor(executor)
    if options["background"] == "transparent" and kind != "png":
        raise InputError(
            f"a transparent background in .{kind}",
            where="--background",
            expected="a color",
            hint="only PNG frames can be transparent: --format png",
        )
    film = FilmOptions(**{key: options[key] for key in FILM_OPTION_NAMES})
    orders = [
        Order(
            volume=volume_spec(one.volume, options),
            film=film,
            colormap=colormap,
            scene=folder / f"{one.name}.yaml",
            output=default_output(one.name, kind, folder),
            executor=executor,
            force=force,
            hides_nonfinite=options["nonfinite"] is None,
        )
        for one in _films(volumes, name, quiet)
    ]
    with sigterm_as_interrupt():
        if name is not None:
            print_film_record(orders[0], quiet=quiet)
            return
        if len(orders) > 1:
            # All but what names one volume: a child is told that last.
            passed = options | {"format": kind, "colormap": colormap, "force": force, "quiet": quiet}
            passed |= {"workers": workers, "scheduler": scheduler}
            run_batch(orders, passed, folder, quiet=quiet)
            return
        _make_single_film(orders[0], quiet=quiet)


def _make_single_film(order: Order, *, quiet: bool) -> None:
    """The only film of a command, which fails as the film does."""
    folder = order.scene.parent
    missing = [each for each in (folder, *folder.parents) if not os.path.exists(each)]
    try:
        result = make_film(order, quiet=quiet)
    except (HsplatError, KeyboardInterrupt) as error:
        for each in missing:  # what was made for nothing
            with suppress(OSError):  # there is something in it
                each.rmdir()
        if not os.path.isdir(folder):
            raise
        with suppress(HsplatError):  # what went wrong first is what is said
            if isinstance(error, HsplatError):
                update_manifest(folder, [order.failed(error)], SHORT_LOCK_TIMEOUT_S)
            else:
                update_manifest(folder, [order.record(INTERRUPTED)], patience_s=0.0)
        raise
    update_manifest(folder, [result])


def _films(volumes: tuple[str, ...], name: str | None, quiet: bool) -> list[NamedVolume]:
    if name is not None:
        return [NamedVolume(Path(volumes[0]), name)]
    found, notes = expand_volumes(volumes)
    if not found:
        raise InputError("there is nothing to render", where="hsplat turntable", got=", ".join(volumes))
    for note in notes:
        if not quiet:
            click.echo(f"note: {note}", err=True)
    return name_volumes(found)
