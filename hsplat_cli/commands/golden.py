"""Run `hsplat golden SCENE FOLDER`: write reference frames of a scene for `hsplat compare`."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import click

from hsplat_cli.commands.shared_options import quiet_option, takes_scene
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import OutputPath, Reporter, parse_frames
from renderer.errors import InputError


@click.command()
@takes_scene("Only these frames, as a Python slice: ::10, 7, -1. [default: all; in an update the golden frames]")
@click.argument("folder", type=OutputPath())
@click.option("--date", metavar="TEXT", help="Record this date for the frames that are drawn, such as 2026-11-21.")
@click.option("--update", is_flag=True, help="List the changes, and overwrite the goldens.")
@click.option("--yes", is_flag=True, help="With --update: do not ask.")
@click.option("--prune", is_flag=True, help="With --update: remove goldens of frames that are not requested.")
@quiet_option(help="Print only errors, and the changes before a question.")
def golden(
    request: SceneRequest,
    *,
    folder: Path,
    date: str | None,
    update: bool,
    yes: bool,
    prune: bool,
    reporter: Reporter,
) -> None:
    """Keep frames of a scene to compare later ones with.

    FOLDER gets frame-0000.png and so on, and golden.json, which records their scene and volume. `hsplat compare SCENE
    FOLDER` draws the frames again and compares them. SCENE may be the JSON file beside a film.
    """
    for option, is_given in (("--yes", yes), ("--prune", prune)):
        if is_given and not update:
            raise InputError("of no use without --update", where=option)
    # Imported here to keep --help fast.
    from hsplat_cli.compare import GoldenOptions, load_reproducible_job, parse_date, update_goldens

    recorded_date = parse_date(date)
    job = load_reproducible_job(request)
    num_frames, frames = job.scene.num_frames, request.frames
    numbers = None if frames is None else parse_frames(frames, num_frames, job.frames)
    golden_options = GoldenOptions(folder, numbers, recorded_date, update=update, prune=prune, yes=yes)
    update_goldens(job, golden_options, reporter, lambda: _confirm_overwrite(reporter))


def _confirm_overwrite(reporter: Reporter) -> bool:
    """Ask the user whether to overwrite the goldens. Raises InputError where nobody can answer."""
    if os.environ.get("CI", "").lower() not in ("", "0", "false"):
        reason = "CI is set in the environment"
    elif not sys.stdin.isatty():
        reason = "the standard input is not a terminal"
    else:
        return reporter.confirm("Overwrite the goldens?")
    raise InputError(
        "goldens are not overwritten without a question, and nobody can answer",
        where="--update",
        got=reason,
        hint="--yes overwrites them without one",
    )
