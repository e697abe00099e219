"""The options by which commands without a scene are told how to read a volume."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeVar

import click

from renderer.errors import InputError
from renderer.scene import FileSource, RawSource, VolumeSpec
from renderer.volume_files import UnknownFormatError

if TYPE_CHECKING:
    from renderer.volume import Volume

_Command = TypeVar("_Command", bound=Callable[..., Any])


def _three(kind: type[int] | type[float]) -> Callable[[click.Context, click.Parameter, str | None], Any]:
    """A callback that makes three positive numbers of `128,96,114`."""

    def convert(_context: click.Context, _parameter: click.Parameter, text: str | None) -> tuple[float, ...] | None:
        if text is None:
            return None
        try:
            numbers = tuple(kind(part) for part in text.split(","))
        except ValueError:
            numbers = ()
        if len(numbers) != 3 or not all(0 < number < float("inf") for number in numbers):
            raise click.BadParameter(f"{text!r} is not three positive numbers with commas between, such as 128,96,114.")
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
    """A decorator for --time, --component, --nonfinite with its default, and the options of a headerless file.

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
            "--shape",
            metavar="X,Y,Z",
            callback=_three(int),
            help="Read a headerless file of this shape; needs --dtype.",
        ),
        click.option("--dtype", help="Type of a headerless file's voxels: uint8, int16, float32, ..."),
        click.option(
            "--byte-order", type=click.Choice(["little", "big"]), default="little", help="Of a headerless file."
        ),
        click.option(
            "--spacing", metavar="X,Y,Z", callback=_three(float), default="1,1,1", help="Of a headerless file."
        ),
        click.option("--offset", type=click.IntRange(min=0), default=0, help="Bytes to skip in a headerless file."),
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
    spacing: tuple[float, float, float],
    offset: int,
) -> VolumeSpec:
    """What the options ask for; `lowest` where no `nonfinite` is given. Raises InputError where one of --shape and
    --dtype is missing."""
    if (shape is None) != (dtype is None):
        raise InputError(
            "a headerless file needs both --shape and --dtype", got="--shape" if shape is not None else "--dtype"
        )
    source: FileSource | RawSource = FileSource(volume)
    if shape is not None and dtype is not None:
        source = RawSource(volume, shape, dtype, byte_order, spacing, offset)
    return VolumeSpec(source, time, component, nonfinite="lowest" if nonfinite is None else nonfinite)


def read_as_told(volume: VolumeSpec) -> Volume:
    """The volume that the options ask for. Raises InputError, with hints about these options, not a scene."""
    from hsplat_cli.shrinking import read_guarded  # noqa: PLC0415  (numpy, for which --help does not wait)

    try:
        return read_guarded(volume)
    except UnknownFormatError as error:
        raise InputError(
            error.what,
            where=error.where,
            got=error.got,
            expected=error.expected,
            hint="voxels without a header are read with --shape and --dtype: --shape 512,512,300 --dtype uint16",
        ) from error
