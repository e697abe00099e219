"""Declares the click options of a turntable without a scene file, once for `init` and `turntable`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import click

from hsplat_cli.scenes.scene_text import FilmOptions
from hsplat_cli.terminal import option_group

_DEFAULT = FilmOptions()

# The options that make a FilmOptions.
FILM_OPTION_NAMES = tuple(field.name for field in fields(FilmOptions))


def _size(_context: click.Context, _parameter: click.Parameter, text: str) -> tuple[int, int]:
    """Parse `512` or `640x480`."""
    parts = text.lower().split("x")
    if len(parts) > 2 or not all(part.isascii() and part.isdigit() and 0 < int(part) <= 16384 for part in parts):
        raise click.BadParameter(f"{text!r} is not a size such as 512 or 640x480, of 1 to 16384 pixels.")
    return int(parts[0]), int(parts[-1])


# `colormap` is for the suggestion, the others are for FilmOptions.
film_options = option_group(
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


def as_arguments(options: Mapping[str, Any]) -> list[str]:
    """Return the command line of parsed options: `frames=30` becomes `--frames=30`; None and False are left out."""
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
    """Return the output of the film `name`; kind: mp4, gif or png."""
    return folder / name / "{frame:04}.png" if kind == "png" else folder / f"{name}.{kind}"
