"""Declares the click options of commands without a scene: how to read a volume, and its turntable."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hsplat_cli.terminal import Reporter, option_group
from renderer.errors import InputError, Problem, SceneError
from renderer.readers import UnknownFormatError
from renderer.scene import COLORMAP_FIELD, MAX_FRAMES, FileSource, OutputSpec, RawSource, VolumeSpec, schema
from renderer.suggest import PRESET_WORDS, FilmOptions

if TYPE_CHECKING:
    from renderer.volume import Volume


# How messages name keys of a scene's `volume`: `time: k` or `component` in the text, and `time: 7` as what was got.
_KEY = re.compile(r"`(time|component|nodata|spacing)(?::( [^`]*))?`")
_HEADERLESS_HINT = "voxels without a header are read with --shape and --dtype: --shape 512,512,300 --dtype uint16"
_GOT = re.compile(r"^(time|component): (-?[0-9]+)$")


def check_as(
    field: schema.FieldType[Any], split: Callable[[str], object] = str, example: str | None = None
) -> Callable[..., Any]:
    """Return a click callback that reads an option as the key of a scene that has this type.

    split: makes a list of the text, for a type that is one. example: a correct text, for a hint.
    """

    def read(_context: click.Context, parameter: click.Parameter, text: str | None) -> Any:
        problems: list[Problem] = []
        value = None if text is None else field.read(schema.TreeNode(split(text), "", problems))
        if problems:
            location = f"{parameter.opts[0]} {text}"
            hint = example and f"such as {parameter.opts[0]} {example}"
            raise SceneError([replace(each, path="", location=location, hint=each.hint or hint) for each in problems])
        return value

    return read


def split_numbers(text: str) -> list[str]:
    """Split `128,96,114` or `128x96x114`."""
    return re.split("[,xX]", text)


def _split_words(text: str) -> str | list[str]:
    """Split `-9999,1e20`; one word stays."""
    return text.split(",") if "," in text else text


_RAW_FIELDS = schema.field_table(RawSource)


def volume_options() -> Callable[[Any], Any]:
    """Declare --time, --component, --spacing, --nodata, and the options of a headerless file."""
    return option_group(
        click.option("--time", type=int, help="Which of several time steps, from 0.  [default: the first]"),
        click.option("--component", type=int, help="Which of several components, from 0.  [default: the first]"),
        click.option(
            "--nodata",
            metavar="auto|none|NUMBER,...",
            callback=check_as(schema.field_table(VolumeSpec)["nodata"], _split_words),
            default="auto",
            show_default=True,
            help="Values that are left out, as NaN is: fill values, none, or these.",
        ),
        click.option(
            "--spacing",
            metavar="X,Y,Z",
            callback=check_as(_RAW_FIELDS["spacing"], split_numbers, "0.1,0.1,0.5"),
            help="Lengths of a voxel, in place of what the file says.",
        ),
        click.option(
            "--shape",
            metavar="X,Y,Z",
            callback=check_as(_RAW_FIELDS["shape"], split_numbers, "128,96,114"),
            help="Read a headerless file of this shape; needs --dtype.",
        ),
        click.option("--dtype", help="Type of a headerless file's voxels: uint8, int16, float32, ..."),
        click.option(
            "--byte-order", type=click.Choice(["little", "big"]), help="Of a headerless file.  [default: little]"
        ),
        click.option("--offset", type=click.IntRange(min=0), help="Bytes to skip in a headerless file."),
    )


_DEFAULT = FilmOptions()


def _split_size(text: str) -> list[str]:
    """Split `640x480`; `512` is both sides."""
    parts = split_numbers(text)
    return parts * 2 if len(parts) == 1 else parts


_check_size = check_as(schema.field_table(OutputSpec)["size"], _split_size, "640x480")
_check_colormap = check_as(COLORMAP_FIELD)
_option = partial(click.option, show_default=True)

# For FilmOptions.
film_options = option_group(
    _option("--frames", type=click.IntRange(1, MAX_FRAMES), default=_DEFAULT.frames, help="Of the whole turn."),
    _option("--size", default="512", callback=_check_size, help="In pixels: 512, or 640x480."),
    _option(
        "--elevation",
        type=click.FloatRange(-90, 90),
        default=_DEFAULT.elevation,
        help="Of the eye above the object, degrees.",
    ),
    _option(
        "--axis",
        type=click.Choice(["x", "y", "z", "-x", "-y", "-z"]),
        default=_DEFAULT.axis,
        help="Around which the eye goes; it is upright in the picture.",
    ),
    _option("--fps", type=click.FloatRange(0.01, 1000), default=_DEFAULT.fps, help="Frames per second."),
    _option("--background", default=_DEFAULT.background, help="A colour, or transparent (PNG only)."),
    _option(
        "--colormap", metavar="NAME", callback=_check_colormap, help="Take the colours from it: viridis, gray, ..."
    ),
    click.option(
        "--preset",
        metavar="WORD|NAME|FILE[#NAME]",
        help=f"Show {', '.join(PRESET_WORDS)}; or take a preset such as ct-bone, or another program's file.",
    ),
    click.option("--no-paths", is_flag=True, help="Record names and no folders beside the film."),
    _option(
        "--tolerance", type=click.FloatRange(0), default=_DEFAULT.tolerance, help="Smaller is more exact and slower."
    ),
)


def volume_spec(volume: Path, options: Mapping[str, Any]) -> VolumeSpec:
    """Return the volume that the options of `volume_options` describe, by their names.

    Raises InputError where one of --shape and --dtype is missing, or another option needs them.
    """
    shape, dtype, spacing = options["shape"], options["dtype"], options["spacing"]
    time, component = options["time"], options["component"]
    if (shape is None) != (dtype is None):
        raise InputError(
            "a headerless file needs both --shape and --dtype", got="--shape" if shape is not None else "--dtype"
        )
    given = {name: options[name] for name in ("byte_order", "offset") if options[name] is not None}
    if shape is not None:
        given |= {"spacing": spacing} if spacing is not None else {}
        return VolumeSpec(RawSource(volume, shape, dtype, **given), time, component, nodata=options["nodata"])
    if given:
        name, value = next(iter(given.items()))
        raise InputError(
            "this is for a file without a header",
            where=f"--{name.replace('_', '-')}",
            got=f"{value}, without --shape and --dtype",
            hint="leave it out: a file with a header says it itself; the voxels of others are read with --shape and "
            "--dtype",
        )
    return VolumeSpec(FileSource(volume, spacing), time, component, nodata=options["nodata"])


def read_with_options(volume: VolumeSpec, reporter: Reporter) -> Volume:
    """Read a volume that options describe, and report the reader's note.

    Raises InputError, with hints about the options and not about a scene.
    """
    from renderer.readers import read_volume

    try:
        read = read_volume(volume)
    except InputError as error:
        error.got, error.expected, error.hint = map(_as_options, (error.got, error.expected, error.hint))
        if isinstance(error, UnknownFormatError):
            error.hint = _HEADERLESS_HINT
        raise
    if read.note is not None:
        reporter.status(f"{read.name}: {_as_options(read.note)}")
    return read


def _as_options(text: str | None) -> str | None:
    """Return a message about a scene's `volume` with options for its keys: `--time k` for `time: k`."""
    return text and _GOT.sub(r"--\1 \2", _KEY.sub(r"`--\1\2`", text.replace("[x, y, z]", "X,Y,Z")))
