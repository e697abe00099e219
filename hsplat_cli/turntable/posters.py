"""Keep a small picture of each film of a folder, and draw them with their names on one picture.

A poster has the time of its film, by which it is known to be that film's. Posters are files of their own: a page whose
films are sorted or searched loads those that it shows, and no other.
"""

from __future__ import annotations

import io
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from renderer.annotation import Font
from renderer.errors import InputError
from renderer.film import Picture, decode_film, over_black, rounded, translate_os_errors, write_staged
from renderer.scene import format_of

_POSTER_PX, _QUALITY = 320, 85
_MAX_FILM_PIXELS = 2**26  # anybody may have put the film there
# The picture with names: the largest number of films, in rows of ten, their size, and the space for a name below.
_MAX_NAMED, _COLUMNS, _NAMED_PX = 200, 10, 160
_LINE_PX, _FONT_PX, _NAME_COLOR = 20, 11, "#e6e6e3"


def is_poster_of(film: Path, poster: Path) -> bool:
    """Return whether a poster is there, and that of this film."""
    try:
        return poster.stat().st_mtime_ns == film.stat().st_mtime_ns
    except OSError:
        return False


def make_poster(film: Path, poster: Path) -> None:
    """Write the first picture of a film, or of a file with its first frame. Raises HsplatError."""
    with translate_os_errors(film):
        time_ns = film.stat().st_mtime_ns
    if format_of(film).is_frames:
        pixels = Picture(file=film).pixels
    else:
        with decode_film(film, _MAX_FILM_PIXELS) as frames:
            pixels = next(frames, np.zeros((1, 1, 3), np.uint8))
    picture, content = Image.fromarray(rounded(over_black(pixels)[..., :3])), io.BytesIO()
    picture.thumbnail((_POSTER_PX, _POSTER_PX), Image.Resampling.LANCZOS)
    picture.save(content, "JPEG", quality=_QUALITY)
    write_staged(poster, content.getvalue(), is_durable=False)
    with translate_os_errors(poster):
        os.utime(poster, ns=(time_ns, time_ns))


def contact_sheet(posters: Sequence[tuple[Path, str]]) -> bytes:
    """Return a PNG file of the first posters, each with a name below. Raises InputError for what is no poster."""
    posters, font = posters[:_MAX_NAMED], Font(None)
    height, content = _NAMED_PX + _LINE_PX, io.BytesIO()
    sheet = Image.new("RGB", (min(_COLUMNS, len(posters)) * _NAMED_PX, -(-len(posters) // _COLUMNS) * height))
    for place, (file, name) in enumerate(posters):
        left, top = place % _COLUMNS * _NAMED_PX, place // _COLUMNS * height
        try:
            with Image.open(file, formats=["JPEG"]) as poster:
                poster.thumbnail((_NAMED_PX, _NAMED_PX))
                sheet.paste(poster, (left + (_NAMED_PX - poster.width) // 2, top + (_NAMED_PX - poster.height) // 2))
        except (OSError, SyntaxError, ValueError) as error:
            hint = "remove it, and it is made again"
            raise InputError("a poster that cannot be read", where=str(file), hint=hint) from error
        try:
            mask = font.line(name, _FONT_PX).mask
        except InputError:  # the font lacks a character
            mask = font.line(ascii(name)[1:-1], _FONT_PX).mask
        sheet.paste(_NAME_COLOR, (left + 4, top + _NAMED_PX + 2), Image.fromarray(mask[:_LINE_PX, : _NAMED_PX - 8]))
    sheet.save(content, "PNG")
    return content.getvalue()
