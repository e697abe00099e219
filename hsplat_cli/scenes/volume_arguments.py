"""Declares the click options of commands without a scene: how to read a volume, and its turntable."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from hsplat_cli.terminal import Reporter, option_group
from renderer.errors import InputError, Problem, SceneError
from renderer.readers import UnknownFormatError
from renderer.scene import (
    COLORMAP_FIELD,
    SUBSET_INDEX_FIELD,
    TOLERANCE_FIELD,
    FileSource,
    OutputSpec,
    RawSource,
    TurntablePath,
    VolumeSpec,
    file_source,
    schema,
)
from renderer.suggest import PRESET_WORDS, FilmOptions

if TYPE_CHECKING:
    from renderer.volume import Volume


# How messages name keys of a scene's `volume`: `time: k` or `component` in the text, and `time: 7` as what was got.
_KEY = re.compile(r"`(time|component|dataset|nodata|spacing)(?::( [^`]*))?`")
_HEADERLESS_HINT = "voxels without a header are read with --shape and --dtype: --shape 512,512,300 --dtype uint16"
_GOT = re.compile(r"^(time|component|dataset): (.+)$")


def split_numbers(text: str) -> list[str]:
    """Split `128,96,114` or `128x96x114`."""
    return re.split("[,xX]", text)


_LENGTHS: dict[str, Any] = {"split": split_numbers, "example": "0.1,0.1,0.5"}
_NUMBERS: dict[str, Any] = {"split": split_numbers, "example": "128,96,114"}
_RAW, _VOLUME, _PATH, _OUTPUT = map(schema.field_table, (RawSource, VolumeSpec, TurntablePath, OutputSpec))


def _keyed(
    name: str,
    field: schema.FieldType[Any],
    metavar: str,
    help_text: str,
    *,
    split: Callable[[str], object] = str,
    example: str | None = None,
    keeps_text: bool = False,
    **others: Any,
) -> Callable[[Any], Any]:
    """Declare an option that is read as the key of a scene that has this type.

    split: makes a list of the text, for a type that is one. example: a correct text, for a hint. keeps_text: pass a
    correct text on as it was given. others: parameters of click's.
    """

    def read(_context: click.Context, _parameter: click.Parameter, text: str | None) -> Any:
        problems: list[Problem] = []
        value = None if text is None else field.read(schema.TreeNode(split(text), "", problems))
        if problems:
            location, hint = f"{name} {text}", example and f"such as {name} {example}"
            raise SceneError([replace(each, path="", location=location, hint=each.hint or hint) for each in problems])
        return text if keeps_text else value

    return click.option(name, type=str, metavar=metavar, callback=read, help=help_text, **others)


def volume_options() -> Callable[[Any], Any]:
    """Declare --time, --component, --dataset, --spacing, --nodata, and the options of a headerless file."""
    return option_group(
        _keyed("--time", SUBSET_INDEX_FIELD, "N", "Which of several time steps, from 0.  [default: the first]"),
        _keyed(
            "--component",
            _VOLUME["component"],
            "N|color",
            "Which of several components, from 0; or color.  [default: the first, or colours]",
        ),
        _keyed("--dataset", _VOLUME["dataset"], "NAME", "Which of HDF5 or netCDF-4.  [default: the only volume]"),
        _keyed(
            "--nodata",
            _VOLUME["nodata"],
            "auto|none|NUMBER,...",
            "Values that are left out, as NaN is: fill values, none, or these.",
            split=lambda text: text.split(",") if "," in text else text,
            default="auto",
            show_default=True,
        ),
        _keyed(
            "--spacing", _RAW["spacing"], "X,Y,Z", "Lengths of a voxel, in place of what the file says.", **_LENGTHS
        ),
        _keyed("--shape", _RAW["shape"], "X,Y,Z", "Read a headerless file of this shape; needs --dtype.", **_NUMBERS),
        _keyed("--dtype", _RAW["dtype"], "TYPE", "Type of a headerless file's voxels: uint8, int16, float32, ..."),
        _keyed("--byte-order", _RAW["byte_order"], "little|big", "Of a headerless file.  [default: little]"),
        _keyed("--offset", _RAW["offset"], "BYTES", "Bytes to skip in a headerless file."),
    )


_DEFAULT = FilmOptions()


def _split_size(text: str) -> list[str]:
    """Split `640x480`; `512` is both sides."""
    parts = split_numbers(text)
    return parts * 2 if len(parts) == 1 else parts


_SIZES: dict[str, Any] = {"split": _split_size, "example": "640x480"}
_option = partial(_keyed, show_default=True)
_RATE = _OUTPUT["frames_per_second"]
_AXIS_HELP = "Around which the eye goes; it is upright in the picture."

# For FilmOptions.
film_options = option_group(
    _option("--frames", _PATH["frames"], "N", "Of the whole turn.", default=_DEFAULT.frames),
    _option("--size", _OUTPUT["size"], "SIZE", "In pixels: 512, or 640x480.", **_SIZES, default="512"),
    _option("--elevation", _PATH["elevation"], "DEGREES", "Of the eye above the object.", default=_DEFAULT.elevation),
    _option("--axis", _PATH["axis"], "x|y|z|-x|-y|-z", _AXIS_HELP, keeps_text=True, default=_DEFAULT.axis),
    _option("--fps", _RATE, "RATE", "Frames per second.", default=_DEFAULT.fps),
    _option(
        "--background",
        _OUTPUT["background"],
        "COLOR",
        "A colour, or transparent.",
        keeps_text=True,
        default=_DEFAULT.background,
    ),
    _option("--colormap", COLORMAP_FIELD, "NAME", "Take the colours from it: viridis, gray, ..."),
    click.option(
        "--preset",
        metavar="WORD|NAME|FILE[#NAME]",
        help=f"Show {', '.join(PRESET_WORDS)}; or take a preset such as ct-bone, or another program's file.",
    ),
    click.option("--over", type=Path, metavar="FILE", help="Show it over this volume, each in its place in the world."),
    _option("--tolerance", TOLERANCE_FIELD, "ERROR", "Smaller is more exact and slower.", default=_DEFAULT.tolerance),
)


def volume_spec(volume: Path, options: Mapping[str, Any], problems: list[InputError] | None = None) -> VolumeSpec:
    """Return the volume that the options of `volume_options` describe, by their names.

    problems: takes the error about a file that names several steps and is damaged, which otherwise is raised. Raises
        InputError where one of --shape and --dtype is missing, or another option needs them.
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
        if options["dataset"] is not None:
            raise InputError("a headerless file has no datasets", where="--dataset", got=options["dataset"])
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
    try:
        source = file_source(volume)
    except InputError as error:
        if problems is None:
            raise
        problems.append(error)
        source = FileSource(volume)
    source = replace(source, spacing=spacing)
    return VolumeSpec(source, time, component, nodata=options["nodata"], dataset=options["dataset"])


def read_with_options(volume: VolumeSpec, reporter: Reporter, *, in_time: bool = False) -> Volume:
    """Read a volume that options describe, and report the reader's note; with `in_time` none on a choice of steps.

    Raises InputError, with hints about the options and not about a scene.
    """
    from renderer.readers import read_volume

    try:
        read = read_volume(volume)
    except InputError as error:
        error.got, error.expected, error.hint = map(_as_options, (error.got, error.expected, error.hint))
        if isinstance(error, UnknownFormatError):
            error.hint = _headerless_hint(error)
        raise
    is_open = in_time and volume.time is None and read.num_times > 1  # its steps are read next
    if read.note is not None and not is_open:
        reporter.status(f"{read.name}: {_as_options(read.note)}")
    return read


def _headerless_hint(error: UnknownFormatError) -> str:
    """Return the options that read a file as voxels without a header: whole ones if its name and size tell them."""
    found = error.declaration
    if found is None:
        return _HEADERLESS_HINT
    file = shlex.quote(error.where or "FILE")
    order = " --byte-order big" * found.is_big_endian
    command = f"hsplat info {file} --shape {','.join(map(str, found.shape))} --dtype {found.dtype}{order}"
    return f"`{command}` reads it as voxels without a header: {found.remark}"


def _as_options(text: str | None) -> str | None:
    """Return a message about a scene's `volume` with options for its keys: `--time k` for `time: k`."""
    return text and _GOT.sub(r"--\1 \2", _KEY.sub(r"`--\1\2`", text.replace("[x, y, z]", "X,Y,Z")))
