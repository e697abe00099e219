"""Declares the click options of commands without a scene: on reading a volume, and on its turntable."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict

import click

from hsplat_cli.terminal import Command, Reporter, VolumePath, packed_options
from renderer.errors import InputError, Problem, SceneError
from renderer.readers import UnknownFormatError
from renderer.scene import (
    COLORMAP_FIELD,
    ENVIRONMENTS,
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
from renderer.suggest import NO_LIGHT, PRESET_WORDS, FilmOptions

if TYPE_CHECKING:
    from renderer.volume import Volume


# Matches a key of a scene's `volume` in the text of a message: `time: k` or `component`.
_KEY = re.compile(r"`(time|component|dataset|level|nodata|spacing)(?::( [^`]*))?`")
# Matches a key of a scene's `volume` with its value, as a message quotes them: `time: 7`.
_GOT = re.compile(r"^(time|component|dataset|level): (.+)$")
_HEADERLESS_HINT = "voxels without a header are read with --shape and --dtype: --shape 512,512,300 --dtype uint16"


def split_numbers(text: str) -> list[str]:
    """Return the parts of a text such as `128,96,114` or `128x96x114`."""
    return re.split("[,xX]", text)


class _ListText(TypedDict):
    """Holds two parameters of `_keyed`, `split` and `example`, for an option whose text is a list."""

    split: Callable[[str], list[str]]
    example: str


# Parameters of `_keyed` for an option that is a list of lengths.
_LENGTHS: _ListText = {"split": split_numbers, "example": "0.1,0.1,0.5"}
# Parameters of `_keyed` for an option that is a list of whole numbers.
_NUMBERS: _ListText = {"split": split_numbers, "example": "128,96,114"}
# The field types of the keys of a scene's `volume.raw`, by key.
_RAW = schema.field_table(RawSource)
# The field types of the keys of a scene's `volume`, by key.
_VOLUME = schema.field_table(VolumeSpec)
# The field types of the keys of a scene's `camera.path` of type turntable, by key.
_PATH = schema.field_table(TurntablePath)
# The field types of the keys of a scene's `output`, by key.
_OUTPUT = schema.field_table(OutputSpec)


def _keyed(
    name: str,
    field: schema.FieldType[Any],
    metavar: str,
    help_text: str,
    *,
    split: Callable[[str], object] = str,
    example: str | None = None,
    keeps_text: bool = False,
    default: str | float | None = None,
) -> Callable[[Command], Command]:
    """Declare an option whose text is read as the value of a key of a scene.

    name: the name of the option. field: the field type of the key. split: a function that splits the text into a list,
    if the value is a list. example: a correct text, for a hint. keeps_text: the command gets the text itself, once it
    is known to be correct, and not the value. default: the default, as text or number, which the help shows.
    """

    def read(_context: click.Context, _parameter: click.Parameter, text: str | None) -> object:
        problems: list[Problem] = []
        value = None if text is None else field.read(schema.TreeNode(split(text), "", problems))
        if problems:
            location, hint = f"{name} {text}", example and f"such as {name} {example}"
            raise SceneError([replace(each, path="", location=location, hint=each.hint or hint) for each in problems])
        return text if keeps_text else value

    def offer(_context: click.Context, _parameter: click.Parameter, incomplete: str) -> list[str]:
        """Return the words that a shell offers: of `metavar`, where capitals stand for other values."""
        return [word for word in metavar.split("|") if word.islower() and word.startswith(incomplete)]

    return click.option(
        name,
        type=str,
        metavar=metavar,
        shell_complete=offer,
        callback=read,
        help=help_text,
        default=default,
        show_default=default is not None,
    )


@dataclass(frozen=True)
class ReadingOptions:
    """The values of the options on reading a volume.

    They are keys of a scene's section `volume`, and of its section `raw` for a file without a header.
    """

    time: int | None = None
    component: int | Literal["all", "color", "color_alpha"] | None = None
    dataset: str | None = None
    level: int | None = None
    nodata: Literal["auto", "none"] | tuple[float, ...] = "auto"
    spacing: tuple[float, float, float] | None = None
    shape: tuple[int, int, int] | None = None
    dtype: str | None = None
    byte_order: Literal["little", "big"] | None = None
    offset: int | None = None


def volume_options() -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Declare the options on reading a volume, which the command gets as its parameter `reading`."""
    return packed_options(
        "reading",
        ReadingOptions,
        _keyed("--time", SUBSET_INDEX_FIELD, "N", "Read this one of several time steps, from 0.  [default: the first]"),
        _keyed(
            "--component",
            _VOLUME["component"],
            "N|color|all",
            "Read this one of several components, from 0; or color; or all, each as light of its own.  "
            "[default: the first, or colours]",
        ),
        _keyed(
            "--dataset",
            _VOLUME["dataset"],
            "NAME",
            "Read this dataset of an HDF5 or netCDF-4 file, or image of a store.  [default: the only volume]",
        ),
        _keyed("--level", _VOLUME["level"], "N", "Read this level of a store, 0 the finest.  [default: one that fits]"),
        _keyed(
            "--nodata",
            _VOLUME["nodata"],
            "auto|none|NUMBER,...",
            "Leave out voxels with fill values (auto), with these numbers, or none; NaN is always left out.",
            split=lambda text: text.split(",") if "," in text else text,
            default="auto",
        ),
        _keyed("--spacing", _RAW["spacing"], "X,Y,Z", "Size of a voxel, in place of the file's own.", **_LENGTHS),
        _keyed("--shape", _RAW["shape"], "X,Y,Z", "Read a headerless file of this shape; needs --dtype.", **_NUMBERS),
        _keyed("--dtype", _RAW["dtype"], "TYPE", "Type of a headerless file's voxels: uint8, int16, float32, ..."),
        _keyed("--byte-order", _RAW["byte_order"], "little|big", "Order in a headerless file.  [default: little]"),
        _keyed("--offset", _RAW["offset"], "BYTES", "Bytes to skip in a headerless file."),
    )


_DEFAULT = FilmOptions()


def _split_size(text: str) -> list[str]:
    """Return the width and the height in a text such as `640x480`, or `512` for both."""
    parts = split_numbers(text)
    return parts * 2 if len(parts) == 1 else parts


# Parameters of `_keyed` for an option that is a size in pixels.
_SIZES: _ListText = {"split": _split_size, "example": "640x480"}
_RATE = _OUTPUT["frames_per_second"]
_LIGHTS = (*ENVIRONMENTS, NO_LIGHT)
_LIGHT_HELP = "Light that matter scatters, from this environment, in place of shading; slower."
_AXIS_HELP = "Turn around this axis, which is upright in the picture."

# Declares the options of a turntable, which the command gets as its parameter `film`.
film_options = packed_options(
    "film",
    FilmOptions,
    _keyed("--frames", _PATH["frames"], "N", "Frames of the whole turn.", default=_DEFAULT.frames),
    _keyed("--size", _OUTPUT["size"], "SIZE", "Pixels of a frame: 512, or 640x480.", **_SIZES, default="512"),
    _keyed(
        "--elevation", _PATH["elevation"], "DEGREES", "Height of the eye above the object.", default=_DEFAULT.elevation
    ),
    _keyed("--axis", _PATH["axis"], "x|y|z|-x|-y|-z", _AXIS_HELP, keeps_text=True, default=_DEFAULT.axis),
    _keyed("--fps", _RATE, "RATE", "Frames per second.", default=_DEFAULT.fps),
    _keyed(
        "--background",
        _OUTPUT["background"],
        "COLOR",
        "A colour, or transparent.",
        keeps_text=True,
        default=_DEFAULT.background,
    ),
    _keyed("--light", schema.choice_field(*_LIGHTS), "|".join(_LIGHTS), _LIGHT_HELP, default=_DEFAULT.light),
    _keyed("--colormap", COLORMAP_FIELD, "NAME", "Take the colours from it: viridis, gray, ..."),
    click.option(
        "--preset",
        metavar="WORD|NAME|FILE[#NAME]",
        shell_complete=lambda _context, _parameter, text: [word for word in PRESET_WORDS if word.startswith(text)],
        help=f"Show {', '.join(PRESET_WORDS)}; or take a preset such as ct-bone, or another program's file.",
    ),
    click.option(
        "--over", type=VolumePath(), metavar="FILE", help="Show it over this volume, both in world coordinates."
    ),
    _keyed("--tolerance", TOLERANCE_FIELD, "ERROR", "Smaller is more exact and slower.", default=_DEFAULT.tolerance),
)


def volume_spec(volume: Path | str, options: ReadingOptions, problems: list[InputError] | None = None) -> VolumeSpec:
    """Return the volume that the options describe.

    volume: a path, or a text that is the URL of a store. problems: a list. If the file lists steps in time and is
    damaged, the error is added to `problems`, or raised if `problems` is None. Raises InputError where only one of
    --shape and --dtype is given, or an option needs both.
    """
    shape, dtype, spacing = options.shape, options.dtype, options.spacing
    time, component = options.time, options.component
    if (shape is None) != (dtype is None):
        raise InputError(
            "a headerless file needs both --shape and --dtype", got="--shape" if shape is not None else "--dtype"
        )
    layout = {"byte_order": options.byte_order, "offset": options.offset}
    given: dict[str, Any] = {name: value for name, value in layout.items() if value is not None}
    if shape is not None and isinstance(volume, str):
        raise InputError("this is for a file without a header", where="--shape", got="the URL of a store")
    if shape is not None and dtype is not None and isinstance(volume, Path):
        given |= {"spacing": spacing} if spacing is not None else {}
        if options.dataset is not None:
            raise InputError("a headerless file has no datasets", where="--dataset", got=options.dataset)
        return VolumeSpec(RawSource(volume, shape, dtype, **given), time, component, nodata=options.nodata)
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
        source = FileSource(Path(volume))
    source = replace(source, spacing=spacing)
    return VolumeSpec(source, time, component, nodata=options.nodata, dataset=options.dataset, level=options.level)


def read_with_options(volume: VolumeSpec, reporter: Reporter, *, in_time: bool = False) -> Volume:
    """Read a volume that options describe, or a coarser level of a large store, and report the reader's note.

    in_time: whether the film shows all steps in time; then a note on the step that was read is left out. Raises
    InputError, with hints that name options and not keys of a scene.
    """
    from renderer.readers import overview_level, read_volume

    try:
        level = overview_level(volume)
        read = read_volume(volume if level is None else replace(volume, level=level))
    except InputError as error:
        error.got, error.expected, error.hint = map(_as_options, (error.got, error.expected, error.hint))
        if isinstance(error, UnknownFormatError):
            error.hint = _headerless_hint(error)
        raise
    if level is not None:
        described = f"level {level} is described, and not the finest; `--level 0` describes the finest"
        read = replace(read, note="; ".join(filter(None, (read.note, described))))
    is_open = in_time and volume.time is None and read.num_times > 1  # the film reads all steps in time
    if read.note is not None and not is_open:
        reporter.status(f"{read.name}: {_as_options(read.note)}")
    return read


def _headerless_hint(error: UnknownFormatError) -> str:
    """Return a hint with the options that read a headerless file, with their values if its name and size show them."""
    found = error.declaration
    if found is None:
        return _HEADERLESS_HINT
    file = shlex.quote(error.where or "FILE")
    order = " --byte-order big" * found.is_big_endian
    command = f"hsplat info {file} --shape {','.join(map(str, found.shape))} --dtype {found.dtype}{order}"
    return f"`{command}` reads it as voxels without a header: {found.remark}"


def _as_options(text: str | None) -> str | None:
    """Return a message about a scene's `volume` with options in place of keys: `--time k` for `time: k`."""
    return text and _GOT.sub(r"--\1 \2", _KEY.sub(r"`--\1\2`", text.replace("[x, y, z]", "X,Y,Z")))
