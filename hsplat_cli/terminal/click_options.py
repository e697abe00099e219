"""Click helpers: groups of options, and the type of an output."""

from __future__ import annotations

import os
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
    """A Path that refuses a leading `~`: shells keep it in `--output=~/films`, and a folder `~` would be made.

    dir_okay: whether it may end as the name of a folder does; a Path drops the slash of `scene.yaml/`.
    """

    def __init__(self, *, file_okay: bool = True, dir_okay: bool = True) -> None:
        super().__init__(path_type=Path, file_okay=file_okay)
        self._may_be_folder = dir_okay

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path; raises InputError for one in a folder `~`, and for a folder in the place of a file."""
        name = "" if param is None else max(param.opts, key=len)
        where = name if name.startswith("-") else name.upper()
        if has_unexpanded_tilde(str(value)):
            raise InputError("a folder named ~", where=where, got=str(value), hint=TILDE_HINT)
        if not self._may_be_folder and os.path.basename(str(value)) in ("", ".", ".."):
            raise InputError("the output is a folder", where=where, got=str(value), expected="the name of a file")
        return super().convert(value, param, ctx)
