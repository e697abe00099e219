"""The descriptions that ImageJ and OME writers put into the first page of a TIFF file: axes and spacing.

ImageJ's is lines of `key=value`. OME's is XML, of which a few attributes are looked for as text: nothing of it is
parsed, expanded or nested.
"""

from __future__ import annotations

import math
import re

from renderer.errors import InputError

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_MAX_COUNT = 2**31 - 1
_SHOWN_CHARACTERS = 40


def is_imagej(description: str) -> bool:
    """Whether ImageJ wrote it."""
    return description.startswith("ImageJ=")


def is_ome(description: str) -> bool:
    """Whether it is OME's XML."""
    return "<OME" in description


def hyperstack(description: str, num_pages: int, where: str) -> tuple[str, list[int]]:
    """The axes of the pages from slowest to fastest, a permutation of `TZC`, and how many there are of each.

    Raises InputError when the description has other pages than there are, or no numbers where they belong.
    """
    if is_imagej(description):
        axes = "TZC"
        frames, channels = (_line(description, key, where) or 1 for key in ("frames", "channels"))
        images, slices = (_line(description, key, where) for key in ("images", "slices"))
        by_axis = {"T": frames, "C": channels}
        by_axis["Z"] = slices or (images // (frames * channels) if images else num_pages)
    elif is_ome(description):
        order = re.search(r'DimensionOrder="XY([CZT]{3})"', description)
        axes = order[1][::-1] if order and len(set(order[1])) == 3 else "TZC"
        by_axis = {axis: _size(description, axis, where) for axis in "TZC"}
    else:
        return "TZC", [1, num_pages, 1]
    counts = [by_axis[axis] for axis in axes]
    if math.prod(counts) != num_pages:
        raise InputError(
            "the description in this TIFF file does not fit its pages",
            where=where,
            got=f"{num_pages} pages",
            expected=" x ".join(f"{by_axis[axis]} {axis}" for axis in axes),
            hint="save it again as a plain stack, all slices in one file",
        )
    return axes, counts


def imagej_step(description: str, where: str) -> float | None:
    """The spacing along z that ImageJ wrote, of either sign, or None; raises InputError when it is no number.

    Words such as NaN say that it is not known.
    """
    found = re.search(r"^spacing=([0-9.eE+-]+)", description, re.M)
    return _number(found[1], "spacing", where) if found else None


def ome_spacing(description: str, where: str) -> list[float | None]:
    """Along x, y and z, None where it is not said, as by words; raises InputError when one is no number."""
    found = {axis: re.search(rf'\bPhysicalSize{axis}="([0-9.eE+-]+)"', description) for axis in "XYZ"}
    return [_number(match[1], f"PhysicalSize{axis}", where) if match else None for axis, match in found.items()]


def _line(description: str, key: str, where: str) -> int | None:
    found = re.search(rf"^{key}=(\S*)", description, re.M)
    return int(_number(found[1], key, where, is_count=True)) if found else None


def _size(description: str, axis: str, where: str) -> int:
    found = re.search(rf'\bSize{axis}="([^"]*)"', description)
    return int(_number(found[1], f"Size{axis}", where, is_count=True)) if found else 1


def _number(text: str, key: str, where: str, *, is_count: bool = False) -> float:
    """What `text`, the value of `key`, says: finite, and whole and positive where it counts pages."""
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if math.isfinite(value) and (not is_count or (value.is_integer() and 1 <= value <= _MAX_COUNT)):
        return value
    shown = ascii(text[:_SHOWN_CHARACTERS])[1:-1] + ("..." if len(text) > _SHOWN_CHARACTERS else "")
    raise InputError(
        "the description in this TIFF file has something else where a number belongs",
        where=where,
        got=f"{key}={shown}",
        expected=f"a whole number from 1 to {_MAX_COUNT}" if is_count else "a finite number",
        hint="save it again as a plain stack, all slices in one file",
    )
