"""Options that several commands share; `help` replaces their text."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from hsplat_cli.terminal import Reporter

FILE = click.Path(path_type=Path)


def _make_reporter(_context: click.Context, _parameter: click.Parameter, is_quiet: bool) -> Reporter:
    return Reporter(is_quiet)


scene_argument = click.argument("scene", type=FILE)
set_option = partial(
    click.option,
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Change a value: --set error.tolerance=0.2",
)
volume_option = partial(click.option, "--volume", type=FILE, metavar="FILE", help="Take the volume from this file.")
frames_option = partial(click.option, "--frames", metavar="A:B:STEP")


def _no_paths_override(_context: click.Context, _parameter: click.Parameter, is_given: bool) -> tuple[str, ...]:
    return ("output.record_paths=false",) * is_given


# What it gives belongs to the overrides of `--set`.
no_paths_option = partial(
    click.option,
    "--no-paths",
    is_flag=True,
    callback=_no_paths_override,
    help="Record names and no folders: the same as --set output.record_paths=false.",
)
quiet_option = partial(
    click.option, "--quiet", "reporter", is_flag=True, callback=_make_reporter, help="Print only errors."
)
