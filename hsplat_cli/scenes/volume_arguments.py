"""The options by which commands without a scene are told how to read a volume."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import click

from hsplat_cli.terminal import Reporter
from renderer.errors import InputError
from renderer.readers import UnknownFormatError
from renderer.scene import MAX_WORLD_LENGTH, MIN_WORLD_LENGTH, FileSource, RawSource, VolumeSpec

if TYPE_CHECKING:
    from renderer.volume import Volume

_Command = TypeVar("_Command", bound=Callable[..., Any])


# As messages have keys of a scene's `volume`: `time: k` or `component` in the text, and time: 7 that was given.
_KEY = re.compile(r"`(time|component|nonfinite|spacing)(?:: ([^`]*))?`")
_GOT = re.compile(r"^(time|component): (-?[0-9]+)$")


def _three_numbers(
    kind: type[int] | type[float], example: str, least: float = 0.0, most: float = math.inf
) -> Callable[[click.Context, click.Parameter, str | None], Any]:
    """A callback that makes three positive numbers, in a range, of `128,96,114`, or `128x96x114` as sizes have it."""

    def convert(_context: click.Context, _parameter: click.Parameter, text: str | None) -> tuple[float, ...] | None:
        if text is None:
            return None
        try:
            numbers = tuple(kind(part) for part in re.split("[,xX]", text))
        except ValueError:
            numbers = ()
        if len(numbers) != 3 or not all(0 < number < float("inf") for number in numbers):
            raise click.BadParameter(f"{text!r} is not three positive numbers with commas between, such as {example}.")
        if not all(least <= number <= most for number in numbers):
            raise click.BadParameter(f"{text!r} has a number that is not from {least:g} to {most:g}.")
        return numbers

    return convert


def _nonfinite(_context: click.Context, _parameter: click.Parameter, text: str | None) -> str | float | None:
    """`error`, `lowest`, or a finite number."""
    if text in (None, "error", "lowest"):
        return text
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise click.BadParameter(f"{text!r} is neither error nor lowest nor a finite number.")
    return number


def volume_options(nonfinite: Literal["error"] | None) -> Callable[[_Command], _Command]:
    """A decorator for --time, --component, --spacing, --nonfinite with its default, and those of a headerless file.

    With the default None, it is None where it is not given: a value that is not seen is to be found.
    """
    options = (
        click.option("--time", type=int, help="Which time step, from 0, of a volume that has several."),
        click.option("--component", type=int, help="Which component, from 0, of a volume that has several."),
        click.option(
            "--nonfinite",
            metavar="error|lowest|NUMBER",
            callback=_nonfinite,
            default=nonfinite,
            show_default=nonfinite or "a value that is not seen",
            help="What to do with NaN and inf: refuse them, or draw them as the lowest value, or as another one.",
        ),
        click.option(
            "--spacing",
            metavar="X,Y,Z",
            callback=_three_numbers(float, "0.1,0.1,0.5", MIN_WORLD_LENGTH, MAX_WORLD_LENGTH),
            help="Lengths of a voxel, in place of what the file says.",
        ),
        click.option(
            "--shape",
            metavar="X,Y,Z",
            callback=_three_numbers(int, "128,96,114"),
            help="Read a headerless file of this shape; needs --dtype.",
        ),
        click.option("--dtype", help="Type of a headerless file's voxels: uint8, int16, float32, ..."),
        click.option(
            "--byte-order", type=click.Choice(["little", "big"]), help="Of a headerless file.  [default: little]"
        ),
        click.option("--offset", type=click.IntRange(min=0), help="Bytes to skip in a headerless file."),
    )

    def decorate(command: _Command) -> _Command:
        for option in reversed(options):
            command = option(command)
        return command

    return decorate


def volume_spec(
    volume: Path,
    *,
    time: int | None,
    component: int | None,
    nonfinite: Any,
    shape: tuple[int, int, int] | None,
    dtype: str | None,
    byte_order: Any,
    spacing: tuple[float, float, float] | None,
    offset: int | None,
) -> VolumeSpec:
    """What the options ask for; `lowest` where no `nonfinite` is given. Raises InputError where one of --shape and
    --dtype is missing."""
    if (shape is None) != (dtype is None):
        raise InputError(
            "a headerless file needs both --shape and --dtype", got="--shape" if shape is not None else "--dtype"
        )
    instead: Literal["error", "lowest"] | float = "lowest" if nonfinite is None else nonfinite
    raw = {"byte_order": byte_order, "offset": offset}
    given = {name: value for name, value in raw.items() if value is not None}
    if shape is not None and dtype is not None:
        given |= {"spacing": spacing} if spacing is not None else {}
        return VolumeSpec(RawSource(volume, shape, dtype, **given), time, component, nonfinite=instead)
    if given:
        name, value = next(iter(given.items()))
        raise InputError(
            "this is for a file without a header",
            where=f"--{name.replace('_', '-')}",
            got=f"{value}, without --shape and --dtype",
            hint="leave it out: a file with a header says it itself; the voxels of others are read with --shape and "
            "--dtype",
        )
    return VolumeSpec(FileSource(volume, spacing), time, component, nonfinite=instead)


def read_with_options(volume: VolumeSpec, reporter: Reporter) -> Volume:
    """The volume that the options ask for; what there is to say of how it was read is said. Raises InputError, with
    hints about these options, not a scene."""
    from hsplat_cli.scenes.truncation_guard import read_volume_guarded

    try:
        read = read_volume_guarded(volume)
    except UnknownFormatError as error:
        raise InputError(
            error.what,
            where=error.where,
            got=error.got,
            expected=error.expected,
            hint="voxels without a header are read with --shape and --dtype: --shape 512,512,300 --dtype uint16",
        ) from error
    except InputError as error:
        raise InputError(
            error.what,
            where=error.where,
            got=error.got and _as_options(_GOT.sub(r"--\1 \2", error.got)),
            expected=error.expected and _as_options(error.expected),
            hint=error.hint and _as_options(error.hint),
        ) from error
    if read.note is not None:
        reporter.status(f"{read.name}: {read.note}")
    return read


def _as_options(text: str) -> str:
    """A message about a scene's `volume` with options in the place of its keys: `--time k` for `time: k`."""

    def option(key: re.Match[str]) -> str:
        value = "X,Y,Z" if key[1] == "spacing" else key[2]
        return f"`--{key[1]} {value}`" if value else f"`--{key[1]}`"

    return _KEY.sub(option, text)
