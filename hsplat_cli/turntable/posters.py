"""Keep a small picture of each film of a folder, in sheets of 10 x 10, and draw them with their names on one picture.

A sheet is a JPEG file that says itself whose picture is in each of its slots. A film keeps its slot while it stays the
same, so that a sheet is written again only where films came or changed. Pictures are multiples of JPEG's blocks of
8 x 8 pixels, and no colour is subsampled: writing a sheet again leaves the others in it as they are, but for rounding.
"""

from __future__ import annotations

import contextlib
import io
import os
import stat
from collections.abc import Collection, Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path

import numpy as np
from PIL import Image

from renderer.annotation import Font
from renderer.errors import InputError
from renderer.film import Picture, bytes_digest, decode_film, frame_path, over_black, write_staged
from renderer.scene import format_of, require_file
from renderer.study import rounded

PER_SIDE, POSTER_PX = 10, 160
NUM_SLOTS, _FREE = PER_SIDE**2, "-"
_QUALITY = 90
_DESCRIPTION = 0x010E  # of EXIF: one line of ASCII
# The picture with names: at most so many films, and the space below each.
_MAX_NAMED, _NAME_PX, _LINE_PX, _NAME_COLOR = 200, 11, 20, "#e6e6e3"
# Of a film, which anybody may have put there.
_MAX_PIXELS = 2**26


def sheet_name(sheet: int) -> str:
    """Return the path of a sheet, relative to the folder of the films."""
    return f"posters/{sheet:04}.jpg"


def poster_key(folder: Path, film: Path) -> str | None:
    """Return what tells this state of a film of the folder from all others; None if it is no file."""
    file = _first_file(folder / film)
    try:
        status = file.stat()
    except (OSError, ValueError):  # the latter for impossible names
        return None
    text = f"{status.st_size} {status.st_mtime_ns} {film}"
    return bytes_digest(os.fsencode(text)) if stat.S_ISREG(status.st_mode) else None


def make_poster(film: Path) -> Image.Image:
    """Return the first frame of a film, as large as fits a slot. Raises HsplatError where it cannot be decoded."""
    if format_of(film).is_frames:
        pixels = Picture(file=_first_file(film)).pixels
    else:
        with decode_film(film, _MAX_PIXELS) as frames:
            pixels = next(frames, np.zeros((1, 1, 3), np.uint8))
    picture = Image.fromarray(rounded(over_black(pixels)[..., :3]))
    picture.thumbnail((POSTER_PX, POSTER_PX), Image.Resampling.LANCZOS)
    poster = Image.new("RGB", (POSTER_PX, POSTER_PX))
    poster.paste(picture, ((POSTER_PX - picture.width) // 2, (POSTER_PX - picture.height) // 2))
    return poster


def _first_file(film: Path) -> Path:
    return frame_path(film, 0) if format_of(film).is_frames else film


def read_slots(folder: Path) -> list[str]:
    """Return the key of the film in each slot of the folder's sheets. Raises InputError for a file that is no sheet."""
    slots: list[str] = []
    while os.path.lexists(file := folder / sheet_name(len(slots) // NUM_SLOTS)):
        with _open_sheet(file) as (_, keys):
            slots += keys
    return slots


def place_posters(folder: Path, current: Collection[str], new: Mapping[str, Image.Image]) -> dict[str, int]:
    """Write new posters into slots, by their keys; return the slot of each current film that has a poster."""
    slots = [key if key in current else _FREE for key in read_slots(folder)]
    missing = [key for key in new if key not in slots]
    slots += [_FREE] * (-(-max(0, len(missing) - slots.count(_FREE)) // NUM_SLOTS) * NUM_SLOTS)
    taken = [slot for slot, key in enumerate(slots) if key == _FREE][: len(missing)]
    for slot, key in zip(taken, missing, strict=True):
        slots[slot] = key
    for sheet, group in groupby(taken, lambda slot: slot // NUM_SLOTS):
        keys = slots[sheet * NUM_SLOTS : (sheet + 1) * NUM_SLOTS]
        _write_sheet(folder / sheet_name(sheet), keys, {slot: new[slots[slot]] for slot in group})
    return {key: slot for slot, key in enumerate(slots) if key != _FREE}


def _write_sheet(file: Path, keys: Sequence[str], posters: Mapping[int, Image.Image]) -> None:
    """Put posters into their slots of a sheet, which may be new."""
    sheet = Image.new("RGB", (PER_SIDE * POSTER_PX,) * 2)
    if file.exists():
        with _open_sheet(file) as (before, _):
            sheet.paste(before)
    for slot, poster in posters.items():
        sheet.paste(poster, _corner(slot))
    exif, content = Image.Exif(), io.BytesIO()
    exif[_DESCRIPTION] = " ".join(keys)
    sheet.save(content, "JPEG", quality=_QUALITY, subsampling=0, exif=exif)
    write_staged(file, content.getvalue(), is_durable=False)


def _corner(slot: int) -> tuple[int, int]:
    return slot % PER_SIDE * POSTER_PX, slot % NUM_SLOTS // PER_SIDE * POSTER_PX


@contextlib.contextmanager
def _open_sheet(file: Path) -> Iterator[tuple[Image.Image, list[str]]]:
    """Open a sheet and read its keys. Raises InputError for another file, also where the block finds it damaged."""
    require_file(file, "a sheet of posters")
    try:
        with Image.open(file, formats=["JPEG"]) as sheet:
            keys = str(sheet.getexif().get(_DESCRIPTION, "")).split()
            if len(keys) != NUM_SLOTS:
                raise ValueError(f"{len(keys)} slots")
            yield sheet, keys
    except (OSError, SyntaxError, ValueError) as error:
        hint = "remove it, and it is made again"
        raise InputError("not a sheet of posters, or a damaged one", where=str(file), hint=hint) from error


def contact_sheet(folder: Path, names: Mapping[int, str]) -> bytes:
    """Return a PNG file of the first posters, with names below them. names: by their slots."""
    shown, font = list(names)[:_MAX_NAMED], Font(None)
    columns, height = min(PER_SIDE, len(shown)), POSTER_PX + _LINE_PX
    picture = Image.new("RGB", (columns * POSTER_PX, -(-len(shown) // columns) * height))
    for sheet, slots in groupby(sorted(shown), lambda slot: slot // NUM_SLOTS):
        with _open_sheet(folder / sheet_name(sheet)) as (posters, _):
            for slot in slots:
                place, (x, y) = shown.index(slot), _corner(slot)
                left, top = place % columns * POSTER_PX, place // columns * height
                picture.paste(posters.crop((x, y, x + POSTER_PX, y + POSTER_PX)), (left, top))
                name = _name_mask(font, names[slot])
                picture.paste(_NAME_COLOR, (left + 4, top + POSTER_PX + 2), name)
    content = io.BytesIO()
    picture.save(content, "PNG")
    return content.getvalue()


def _name_mask(font: Font, name: str) -> Image.Image:
    """Draw a name as a mask, as much as fits; one that the font lacks characters of in ASCII."""
    try:
        mask = font.line(name, _NAME_PX).mask
    except InputError:
        mask = font.line(ascii(name)[1:-1], _NAME_PX).mask
    return Image.fromarray(mask[:_LINE_PX, : POSTER_PX - 8])
