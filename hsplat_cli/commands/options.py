"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from hsplat_cli.terminal import Reporter

_Command = TypeVar("_Command", bound=Callable[..., Any])

FILE = click.Path(path_type=Path)

scene_argument = click.argument("scene", type=FILE)


def set_option(text: str = "Change a value: --set error.tolerance=0.2") -> Callable[[_Command], _Command]:
    """Return a decorator for --set, as `overrides`."""
    return click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help=text)


def volume_option(text: str = "Take the volume from this file.") -> Callable[[_Command], _Command]:
    """Return a decorator for --volume."""
    return click.option("--volume", type=FILE, metavar="FILE", help=text)


def frames_option(text: str) -> Callable[[_Command], _Command]:
    """Return a decorator for --frames, as text."""
    return click.option("--frames", metavar="A:B:STEP", help=text)


def quiet_option(text: str = "Print only errors.") -> Callable[[_Command], _Command]:
    """Return a decorator for --quiet, as `reporter`."""

    def make_reporter(_context: click.Context, _parameter: click.Parameter, is_quiet: bool) -> Reporter:
        return Reporter(is_quiet)

    return click.option("--quiet", "reporter", is_flag=True, callback=make_reporter, help=text)
