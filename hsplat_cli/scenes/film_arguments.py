"""The options of a turntable that is made without a scene file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from hsplat_cli.scenes.scene_text import FilmOptions

_Command = TypeVar("_Command", bound=Callable[..., Any])

_DEFAULT = FilmOptions()

# Options that `make_film_options` takes.
FILM_OPTION_NAMES = ("frames", "size", "elevation", "axis", "fps", "background", "tolerance")


def _size(_context: click.Context, _parameter: click.Parameter, text: str) -> tuple[int, int]:
    """`512` or `640x480`."""
    parts = text.lower().split("x")
    if len(parts) > 2 or not all(part.isascii() and part.isdigit() and 0 < int(part) <= 16384 for part in parts):
        raise click.BadParameter(f"{text!r} is not a size such as 512 or 640x480, of 1 to 16384 pixels.")
    return int(parts[0]), int(parts[-1])


_OPTIONS = (
    click.option(
        "--frames",
        type=click.IntRange(1, 1_000_000),
        default=_DEFAULT.frames,
        show_default=True,
        help="Of the whole turn.",
    ),
    click.option("--size", default="512", show_default=True, callback=_size, help="In pixels: 512, or 640x480."),
    click.option(
        "--elevation",
        type=click.FloatRange(-90, 90),
        default=_DEFAULT.elevation,
        show_default=True,
        help="Of the eye above the object, degrees.",
    ),
    click.option(
        "--axis",
        type=click.Choice(["x", "y", "z", "-x", "-y", "-z"]),
        default=_DEFAULT.axis,
        show_default=True,
        help="Around which the eye goes; it is upright in the picture.",
    ),
    click.option(
        "--fps", type=click.FloatRange(0.01, 1000), default=_DEFAULT.fps, show_default=True, help="Frames per second."
    ),
    click.option(
        "--background", default=_DEFAULT.background, show_default=True, help="A colour, or transparent (PNG only)."
    ),
    click.option("--colormap", metavar="NAME", help="Take the colours from it: viridis, gray, ..."),
    click.option(
        "--tolerance",
        type=click.FloatRange(0),
        default=_DEFAULT.tolerance,
        show_default=True,
        help="Smaller is more exact and slower.",
    ),
)


def film_options(command: _Command) -> _Command:
    """A decorator for all of them."""
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


def make_film_options(
    *,
    frames: int,
    size: tuple[int, int],
    elevation: float,
    axis: str,
    fps: float,
    background: str,
    tolerance: float,
) -> FilmOptions:
    """What they say; `colormap` is for the suggestion."""
    return FilmOptions(frames, elevation, axis, tolerance, size, fps, background)


def as_arguments(options: dict[str, Any]) -> list[str]:
    """The command line that says the same: `frames=30` becomes `--frames=30`, and what is None is left out."""
    words = []
    for name, value in options.items():
        if value is None or value is False:
            continue
        flag = "--" + name.replace("_", "-")
        if value is True:
            words.append(flag)
        elif name == "size":
            words.append(f"{flag}={value[0]}x{value[1]}")
        elif isinstance(value, tuple):
            words.append(f"{flag}={','.join(map(repr, value))}")
        else:
            words.append(f"{flag}={value!r}" if isinstance(value, float) else f"{flag}={value}")
    return words


def default_output(name: str, kind: str, folder: Path) -> Path:
    """The film of a volume called `name`: of the format mp4, gif or png."""
    return folder / name / "{frame:04}.png" if kind == "png" else folder / f"{name}.{kind}"
