"""Declares the click options that say how to read a volume, once for the commands without a scene."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from hsplat_cli.terminal import Reporter, option_group
from renderer.errors import InputError
from renderer.readers import UnknownFormatError
from renderer.scene import MAX_WORLD_LENGTH, MIN_WORLD_LENGTH, FileSource, RawSource, VolumeSpec

if TYPE_CHECKING:
    from renderer.volume import Volume


# How messages name keys of a scene's `volume`: `time: k` or `component` in the text, and `time: 7` as what was got.
_KEY = re.compile(r"`(time|component|nonfinite|spacing)(?:: ([^`]*))?`")
_HEADERLESS_HINT = "voxels without a header are read with --shape and --dtype: --shape 512,512,300 --dtype uint16"
_GOT = re.compile(r"^(time|component): (-?[0-9]+)$")


def _three_numbers(
    kind: type[int] | type[float], example: str, least: float = 0.0, most: float = math.inf
) -> Callable[[click.Context, click.Parameter, str | None], Any]:
    """Return a callback that parses three positive numbers in a range: `128,96,114`, or `128x96x114`."""

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
    """Parse `error`, `lowest`, or a finite number."""
    if text in (None, "error", "lowest"):
        return text
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        raise click.BadParameter(f"{text!r} is neither error nor lowest nor a finite number.")
    return number


def volume_options(nonfinite: Literal["error"] | None) -> Callable[[Any], Any]:
    """Declare --time, --component, --spacing, --nonfinite with its default, and the options of a headerless file.

    With the default None, --nonfinite is None where it is not given: a fill value that is not visible is looked for.
    """
    return option_group(
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


def volume_spec(volume: Path, options: Mapping[str, Any]) -> VolumeSpec:
    """Return the volume that the options of `volume_options` describe, by their names; `lowest` for no `nonfinite`.

    Raises InputError where one of --shape and --dtype is missing, or another option needs them.
    """
    shape, dtype, spacing = options["shape"], options["dtype"], options["spacing"]
    time, component = options["time"], options["component"]
    if (shape is None) != (dtype is None):
        raise InputError(
            "a headerless file needs both --shape and --dtype", got="--shape" if shape is not None else "--dtype"
        )
    nonfinite: Any = "lowest" if options["nonfinite"] is None else options["nonfinite"]
    given = {name: options[name] for name in ("byte_order", "offset") if options[name] is not None}
    if shape is not None:
        given |= {"spacing": spacing} if spacing is not None else {}
        return VolumeSpec(RawSource(volume, shape, dtype, **given), time, component, nonfinite=nonfinite)
    if given:
        name, value = next(iter(given.items()))
        raise InputError(
            "this is for a file without a header",
            where=f"--{name.replace('_', '-')}",
            got=f"{value}, without --shape and --dtype",
            hint="leave it out: a file with a header says it itself; the voxels of others are read with --shape and "
            "--dtype",
        )
    return VolumeSpec(FileSource(volume, spacing), time, component, nonfinite=nonfinite)


def read_with_options(volume: VolumeSpec, reporter: Reporter) -> Volume:
    """Read a volume that options describe, and report the reader's note.

    Raises InputError, with hints about the options and not about a scene.
    """
    from hsplat_cli.scenes.truncation_guard import read_volume_guarded

    try:
        read = read_volume_guarded(volume)
    except InputError as error:
        hint = error.hint and _as_options(error.hint)
        raise InputError(
            error.what,
            where=error.where,
            got=error.got and _as_options(_GOT.sub(r"--\1 \2", error.got)),
            expected=error.expected and _as_options(error.expected),
            hint=_HEADERLESS_HINT if isinstance(error, UnknownFormatError) else hint,
        ) from error
    if read.note is not None:
        reporter.status(f"{read.name}: {read.note}")
    return read


def _as_options(text: str) -> str:
    """Return a message about a scene's `volume` with options for its keys: `--time k` for `time: k`."""

    def option(key: re.Match[str]) -> str:
        value = "X,Y,Z" if key[1] == "spacing" else key[2]
        return f"`--{key[1]} {value}`" if value else f"`--{key[1]}`"

    return _KEY.sub(option, text)
