"""Declares the click options of a turntable without a scene file, once for `init` and `turntable`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import click

from hsplat_cli.scenes.scene_text import FilmOptions
from hsplat_cli.scenes.volume_arguments import check_as, split_numbers
from hsplat_cli.terminal import option_group
from renderer.scene import COLORMAP_FIELD, MAX_FRAMES, OutputSpec, field_table

_DEFAULT = FilmOptions()


def _split_size(text: str) -> list[str]:
    """Split `640x480`; `512` is both sides."""
    parts = split_numbers(text)
    return parts * 2 if len(parts) == 1 else parts


_check_size = check_as(field_table(OutputSpec)["size"], _split_size, "640x480")
_check_colormap = check_as(COLORMAP_FIELD)
_option = partial(click.option, show_default=True)

# `colormap` is for the suggestion, the others are for FilmOptions.
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
    click.option("--no-paths", is_flag=True, help="Record names and no folders beside the film."),
    _option(
        "--tolerance", type=click.FloatRange(0), default=_DEFAULT.tolerance, help="Smaller is more exact and slower."
    ),
)


def as_arguments(options: Mapping[str, Any]) -> list[str]:
    """Return the command line of parsed options: `frames=30` becomes `--frames=30`; None and False are left out."""
    words = []
    for name, value in options.items():
        flag = "--" + name.replace("_", "-")
        if value is True:
            words.append(flag)
        elif value is not None and value is not False:
            words.append(f"{flag}={','.join(map(str, value)) if isinstance(value, tuple) else value}")
    return words


def default_output(name: str, kind: str, folder: Path) -> Path:
    """Return the output of the film `name`; kind: mp4, gif or png."""
    return folder / name / "{frame:04}.png" if kind == "png" else folder / f"{name}.{kind}"
