"""Click helpers: groups of options, and the type of an output."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from renderer.errors import InputError
from renderer.scene import TILDE_HINT, has_unexpanded_tilde

_Command = TypeVar("_Command", bound=Callable[..., Any])


def option_group(*options: Callable[[Any], Any]) -> Callable[[_Command], _Command]:
    """Return a decorator that declares several click options, in this order."""

    def declare(command: _Command) -> _Command:
        for option in reversed(options):
            command = option(command)
        return command

    return declare


class OutputPath(click.Path):
    """A Path that refuses a leading `~`: shells keep it in `--output=~/films`, and a folder `~` would be made."""

    def __init__(self, *, file_okay: bool = True) -> None:
        super().__init__(path_type=Path, file_okay=file_okay)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path; raises InputError for one in a folder `~`."""
        if has_unexpanded_tilde(str(value)):
            name = "" if param is None else max(param.opts, key=len)
            where = name if name.startswith("-") else name.upper()
            raise InputError("a folder named ~", where=where, got=str(value), hint=TILDE_HINT)
        return super().convert(value, param, ctx)
