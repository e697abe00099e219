"""Declares the click options of commands without a scene: how to read a volume, and its turntable."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from hsplat_cli.terminal import Reporter, option_group
from renderer.errors import InputError, Problem, SceneError
from renderer.readers import UnknownFormatError
from renderer.scene import (
    COLORMAP_FIELD,
    TOLERANCE_FIELD,
    FileSource,
    OutputSpec,
    RawSource,
    TurntablePath,
    VolumeSpec,
    schema,
)
from renderer.suggest import PRESET_WORDS, FilmOptions

if TYPE_CHECKING:
    from renderer.volume import Volume


# How messages name keys of a scene's `volume`: `time: k` or `component` in the text, and `time: 7` as what was got.
_KEY = re.compile(r"`(time|component|nonfinite|spacing)(?::( [^`]*))?`")
_HEADERLESS_HINT = "voxels without a header are read with --shape and --dtype: --shape 512,512,300 --dtype uint16"
_GOT = re.compile(r"^(time|component): (-?[0-9]+)$")


def check_as(
    field: schema.FieldType[Any],
    split: Callable[[str], object] = str,
    example: str | None = None,
    *,
    keeps_text: bool = False,
) -> Callable[..., Any]:
    """Return a click callback that reads an option as the key of a scene that has this type.

    split: makes a list of the text, for a type that is one. example: a correct text, for a hint. keeps_text: return a
    correct text as it was given.
    """

    def read(_context: click.Context, parameter: click.Parameter, text: str | None) -> Any:
        problems: list[Problem] = []
        value = None if text is None else field.read(schema.TreeNode(split(text), "", problems))
        if problems:
            location = f"{parameter.opts[0]} {text}"
            hint = example and f"such as {parameter.opts[0]} {example}"
            raise SceneError([replace(each, path="", location=location, hint=each.hint or hint) for each in problems])
        return text if keeps_text else value

    return read


def split_numbers(text: str) -> list[str]:
    """Split `128,96,114` or `128x96x114`."""
    return re.split("[,xX]", text)


_RAW, _VOLUME, _PATH, _OUTPUT = map(schema.field_table, (RawSource, VolumeSpec, TurntablePath, OutputSpec))
_keyed = partial(click.option, type=str)  # the types of keys read text


def volume_options(nonfinite: Literal["error"] | None) -> Callable[[Any], Any]:
    """Declare --time, --component, --spacing, --nonfinite with its default, and the options of a headerless file.

    With the default None, --nonfinite is None where it is not given: a fill value that is not visible is looked for.
    """
    return option_group(
        _keyed(
            "--time",
            callback=check_as(_VOLUME["time"]),
            help="Which of several time steps, from 0.  [default: the first]",
        ),
        _keyed(
            "--component",
            callback=check_as(_VOLUME["component"]),
            help="Which of several components, from 0.  [default: the first]",
        ),
        _keyed(
            "--nonfinite",
            metavar="error|lowest|NUMBER",
            callback=check_as(_VOLUME["nonfinite"]),
            default=nonfinite,
            show_default=nonfinite or "a value that is not seen",
            help="What to do with NaN and inf: refuse them, or draw them as the lowest value, or as another one.",
        ),
        _keyed(
            "--spacing",
            metavar="X,Y,Z",
            callback=check_as(_RAW["spacing"], split_numbers, "0.1,0.1,0.5"),
            help="Lengths of a voxel, in place of what the file says.",
        ),
        _keyed(
            "--shape",
            metavar="X,Y,Z",
            callback=check_as(_RAW["shape"], split_numbers, "128,96,114"),
            help="Read a headerless file of this shape; needs --dtype.",
        ),
        _keyed(
            "--dtype",
            metavar="TYPE",
            callback=check_as(_RAW["dtype"]),
            help="Type of a headerless file's voxels: uint8, int16, float32, ...",
        ),
        _keyed(
            "--byte-order",
            metavar="little|big",
            callback=check_as(_RAW["byte_order"]),
            help="Of a headerless file.  [default: little]",
        ),
        _keyed(
            "--offset", metavar="BYTES", callback=check_as(_RAW["offset"]), help="Bytes to skip in a headerless file."
        ),
    )


_DEFAULT = FilmOptions()


def _split_size(text: str) -> list[str]:
    """Split `640x480`; `512` is both sides."""
    parts = split_numbers(text)
    return parts * 2 if len(parts) == 1 else parts


_option = partial(_keyed, show_default=True)

# For FilmOptions.
film_options = option_group(
    _option(
        "--frames",
        metavar="N",
        default=_DEFAULT.frames,
        callback=check_as(_PATH["frames"]),
        help="Of the whole turn.",
    ),
    _option(
        "--size",
        default="512",
        callback=check_as(_OUTPUT["size"], _split_size, "640x480"),
        help="In pixels: 512, or 640x480.",
    ),
    _option(
        "--elevation",
        metavar="DEGREES",
        default=_DEFAULT.elevation,
        callback=check_as(_PATH["elevation"]),
        help="Of the eye above the object, -90 to 90.",
    ),
    _option(
        "--axis",
        metavar="x|y|z|-x|-y|-z",
        default=_DEFAULT.axis,
        callback=check_as(_PATH["axis"], keeps_text=True),
        help="Around which the eye goes; it is upright in the picture.",
    ),
    _option(
        "--fps",
        metavar="RATE",
        default=_DEFAULT.fps,
        callback=check_as(_OUTPUT["frames_per_second"]),
        help="Frames per second.",
    ),
    _option(
        "--background",
        metavar="COLOR",
        default=_DEFAULT.background,
        callback=check_as(_OUTPUT["background"], keeps_text=True),
        help="A colour, or transparent (PNG only).",
    ),
    _option(
        "--colormap",
        metavar="NAME",
        callback=check_as(COLORMAP_FIELD),
        help="Take the colours from it: viridis, gray, ...",
    ),
    click.option(
        "--preset",
        metavar="WORD|NAME|FILE[#NAME]",
        help=f"Show {', '.join(PRESET_WORDS)}; or take a preset such as ct-bone, or another program's file.",
    ),
    click.option("--no-paths", is_flag=True, help="Record names and no folders beside the film."),
    _option(
        "--tolerance",
        metavar="ERROR",
        default=_DEFAULT.tolerance,
        callback=check_as(TOLERANCE_FIELD),
        help="Smaller is more exact and slower.",
    ),
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
