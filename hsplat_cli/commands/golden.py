"""`hsplat golden SCENE FOLDER`: frames that a scene is to go on giving, kept for `hsplat compare`."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import click

from hsplat_cli.executors import ExecutorSpec, workers_option
from hsplat_cli.terminal import OutputPath, parse_frames, report_first_run, sigterm_as_interrupt
from renderer.errors import InputError


@click.command()
@click.argument("scene", type=click.Path(path_type=Path))
@click.argument("folder", type=OutputPath())
@click.option(
    "--frames",
    metavar="A:B:STEP",
    help="Only these frames, as Python slices them: ::10, 7, -1. [default: all; in an update those that are golden]",
)
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value: --set error.tolerance=0.2"
)
@click.option("--volume", type=click.Path(path_type=Path), metavar="FILE", help="Take the volume from this file.")
@click.option("--date", metavar="TEXT", help="Write this date down for what is drawn, such as 2026-11-21.")
@click.option("--update", is_flag=True, help="Say what has changed, and write it over the goldens that are there.")
@click.option("--yes", is_flag=True, help="With --update: do not ask.")
@click.option("--prune", is_flag=True, help="With --update: remove goldens of frames that are not asked for.")
@workers_option
@click.option("--quiet", is_flag=True, help="Say nothing but errors, and what a question is about.")
def golden(
    scene: Path,
    folder: Path,
    frames: str | None,
    overrides: tuple[str, ...],
    volume: Path | None,
    date: str | None,
    update: bool,
    yes: bool,
    prune: bool,
    workers: int | None,
    quiet: bool,
) -> None:
    """Keep frames of a scene to compare later ones with.

    FOLDER gets frame-0000.png and so on, and golden.json, which says what they were drawn from. `hsplat compare SCENE
    FOLDER` draws them again and compares. SCENE may be the JSON file beside a film.
    """
    for option, is_given in (("--yes", yes), ("--prune", prune)):
        if is_given and not update:
            raise InputError("of no use without --update", where=option)
    with sigterm_as_interrupt():
        # Imported here: numpy takes longer to load than --help may take to answer.
        from hsplat_cli.compare import GoldenOptions, load_reproducible_job, parse_date, update_goldens

        recorded_date = parse_date(date)
        job = load_reproducible_job(scene, overrides=overrides, volume=volume)
        numbers = None if frames is None else parse_frames(frames, job.scene.camera.path.frames, job.frames)
        report_first_run(quiet=quiet)
        golden_options = GoldenOptions(folder, numbers, recorded_date, update=update, prune=prune, yes=yes, quiet=quiet)
        update_goldens(job, golden_options, ExecutorSpec(workers), _confirm_overwrite)


def _confirm_overwrite() -> bool:
    """Whether the user says so. Raises InputError where nobody can be asked."""
    if os.environ.get("CI", "").lower() not in ("", "0", "false"):
        reason = "CI is set in the environment"
    elif not sys.stdin.isatty():
        reason = "the standard input is no terminal"
    else:
        return click.confirm("Write over the goldens?")
    raise InputError(
        "goldens are not written over without a question, and nobody can be asked",
        where="--update",
        got=reason,
        hint="--yes writes over them without one",
    )
