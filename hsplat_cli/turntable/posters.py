"""Keeps a small picture, a poster, of each film of a folder, and draws all posters with their names on one picture.

A poster has the modification time of its film, so a poster of an earlier film is recognised. Each poster is a file, so
that a page loads only the posters that it shows.
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

# Longest side of a poster, in pixels.
_POSTER_PX = 320
# Quality of a poster's JPEG file, on a scale to 100.
_QUALITY = 85
# Largest number of pixels of a film's frame that is decoded. The film may come from anywhere.
_MAX_FILM_PIXELS = 2**26
# Largest number of films on contact.png, the picture of all posters with names.
_MAX_NAMED = 200
# Number of films in a row of contact.png.
_COLUMNS = 10
# Width and height of the place for a poster on contact.png, in pixels.
_NAMED_PX = 160
# Height of the place for a film's name on contact.png, in pixels.
_LINE_PX = 20
# Size of the letters of a film's name on contact.png, in pixels.
_FONT_PX = 11
_NAME_COLOR = "#e6e6e3"


def is_poster_of(film: Path, poster: Path) -> bool:
    """Return whether a poster exists and belongs to this film."""
    try:
        return poster.stat().st_mtime_ns == film.stat().st_mtime_ns
    except OSError:
        return False


def make_poster(film: Path, poster: Path) -> None:
    """Write the poster of a film, which is a film file or the file of its first frame. Raises HsplatError."""
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
    """Return a PNG file with the first _MAX_NAMED posters, each above its film's name.

    posters: the file and the film's name of each poster. Raises InputError for an unreadable poster.
    """
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
