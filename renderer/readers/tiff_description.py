"""The descriptions that ImageJ and OME writers put into the first page of a TIFF file: axes and spacing.

ImageJ's is lines of `key=value`. OME's is XML, of which a few attributes are looked for as text: nothing of it is
parsed, expanded or nested.
"""

from __future__ import annotations

import html
import math
import re
import unicodedata
from fractions import Fraction

from renderer.errors import InputError

_NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
_MAX_COUNT = 2**31 - 1
_SHOWN_CHARACTERS = 40

_PIXELS = re.compile(r"<(?:\w+:)?Pixels\b[^<>]*>")

# Of OME's units of length (OME 2016-06, UnitsLength) those that can be converted. `pixel` and `reference frame` stand
# for no length, and are units of their own, as is what is no unit of OME's; without any it is µm.
_PREFIXES = {"Y": 24, "Z": 21, "E": 18, "P": 15, "T": 12, "G": 9, "M": 6, "k": 3, "h": 2, "da": 1, "": 0, "d": -1}
_PREFIXES |= {"c": -2, "m": -3, "µ": -6, "n": -9, "p": -12, "f": -15, "a": -18, "z": -21, "y": -24}
_INCH = Fraction(254, 10_000)
_OTHERS = {
    "Å": Fraction(1, 10**10),
    "ua": Fraction(149_597_870_700),
    "ly": Fraction(9_460_730_472_580_800),
    "pc": Fraction(149_597_870_700 * 648_000 / math.pi),
    "thou": _INCH / 1000,
    "li": _INCH / 12,
    "in": _INCH,
    "ft": _INCH * 12,
    "yd": _INCH * 36,
    "mi": _INCH * 63_360,
    "pt": _INCH / 72,
}
_METRES = {f"{prefix}m": Fraction(10) ** power for prefix, power in _PREFIXES.items()} | _OTHERS
_METRES = {unicodedata.normalize("NFKC", unit): metres for unit, metres in _METRES.items()}

# The unit of the resolution by its number in the field, and how many mm it has.
_UNITS_OF_TAG = {2: "inch", 3: "cm"}
MM_PER_UNIT = {2: 25.4, 3: 10.0}
# How ImageJ's users spell units; pixels are none.
_MICRON = unicodedata.normalize("NFKC", "µm")
_NAMES_OF_UNITS = dict.fromkeys(("um", _MICRON, "micron", "microns", "micrometer", "micrometers"), _MICRON)
_NAMES_OF_UNITS |= dict.fromkeys(("in", "inch", "inches"), "inch") | dict.fromkeys(("pixel", "pixels"), "")
_NAMES_OF_UNITS |= dict.fromkeys(("cm", "centimeter", "centimeters"), "cm")


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


def imagej_spacing(description: str, sizes: list[float | None], tag: int | None, where: str) -> list[float | None]:
    """Along x, y and z, in the unit that ImageJ's description names, or in mm where the resolution is per inch or cm;
    None where it is not said.

    sizes: of x and y, by the resolution. tag: the number of its unit, None where that field is not there. Sizes per cm
    beside a unit of µm are converted, as ImageJ does. Raises InputError for other units beside inch and cm, which
    ImageJ takes for the unit of x and y and others do not, and when a spacing is no number.
    """
    step = _imagej_step(description, where)
    units = {axis: _imagej_unit(description, key) for axis, key in zip("xyz", ("unit", "yunit", "zunit"), strict=True)}
    unit = units["x"]
    others = [name for name in (units["y"], units["z"]) if name not in ("", unit)]
    if tag is None and not unit:
        tag = 2  # as TIFF has it
    per = _UNITS_OF_TAG.get(tag or 0, "")
    x, y = sizes
    z = step and abs(step)  # of which 0 is none
    if not others and per == "cm" and unit == _MICRON:
        return [x and x * 1e4, y and y * 1e4, z]
    if others or (per and unit not in ("", per)):
        raise InputError(
            "the voxel sizes in this TIFF file are in units that cannot be compared",
            where=where,
            got=f"pixels per {per}; " * bool(per)
            + ", ".join(f"{axis} in {_shown(units[axis]) or unit}" for axis in units),
            expected="one unit for all, or pixels per cm and unit=um",
            hint="`spacing: [x, y, z]` replaces the spacing in the file",
        )
    factor = MM_PER_UNIT[tag] if tag and per else 1.0
    return [size and size * factor for size in (x, y, z)]


def _imagej_unit(description: str, key: str) -> str:
    """The unit of a line of ImageJ's, by one of its names; empty where it is none, or pixels."""
    found = re.search(rf"^{key}=(.*)$", description, re.M)
    text = re.sub(r"\\u([0-9a-fA-F]{4})", lambda code: chr(int(code[1], 16)), found[1]) if found else ""
    name = unicodedata.normalize("NFKC", text.replace("\ufffdm", "µm").strip())
    return _NAMES_OF_UNITS.get(name.lower(), name)


def _imagej_step(description: str, where: str) -> float | None:
    """The spacing along z that ImageJ wrote, of either sign, or None; raises InputError when it is no number.

    Words such as NaN say that it is not known.
    """
    found = re.search(r"^spacing=([0-9.eE+-]+)", description, re.M)
    return _number(found[1], "spacing", where) if found else None


def ome_spacing(description: str, where: str) -> list[float | None]:
    """Along x, y and z, in the unit of the first that is said; None where it is not said, as by words.

    Raises InputError when one is no number, and for units of which none can be had from the other.
    """
    pixels = _PIXELS.search(description)
    attributes = pixels[0] if pixels else description
    found = {axis: re.search(rf'\bPhysicalSize{axis}="([0-9.eE+-]+)"', attributes) for axis in "XYZ"}
    said = {axis: _number(match[1], f"PhysicalSize{axis}", where) for axis, match in found.items() if match}
    sizes = {axis: size for axis, size in said.items() if size}  # of which 0 is none
    units = {axis: _unit(attributes, axis) for axis in sizes}
    first = next(iter(units.values()), "")
    if any(unit != first and not {unit, first} <= _METRES.keys() for unit in units.values()):
        raise InputError(
            "the voxel sizes in this TIFF file are in units that cannot be compared",
            where=where,
            got=", ".join(f"PhysicalSize{axis}={sizes[axis]:g} {_shown(units[axis])}" for axis in sizes),
            expected="one unit for all, or units of length such as nm, µm and mm",
            hint="`spacing: [x, y, z]` replaces the spacing in the file",
        )
    return [_converted(sizes[axis], units[axis], first) if axis in sizes else None for axis in "XYZ"]


def _unit(attributes: str, axis: str) -> str:
    """The unit of a PhysicalSize, in one of the ways in which Unicode spells it."""
    found = re.search(rf'\bPhysicalSize{axis}Unit="([^"]*)"', attributes)
    # A file in Latin 1 was read as UTF-8: what stands for its one letter that is not ASCII.
    text = html.unescape(found[1]).replace("\ufffdm", "µm").replace("\ufffd", "Å") if found else "µm"
    return unicodedata.normalize("NFKC", text.strip())


def _converted(size: float, unit: str, into: str) -> float:
    """A size in another unit, rounded once; infinite beyond all numbers."""
    if unit == into:
        return size
    try:
        return float(Fraction(size) * _METRES[unit] / _METRES[into])
    except OverflowError:
        return math.inf


def _line(description: str, key: str, where: str) -> int | None:
    found = re.search(rf"^{key}=(\S*)", description, re.M)
    return int(_number(found[1], key, where, is_count=True)) if found else None


def _size(description: str, axis: str, where: str) -> int:
    found = re.search(rf'\bSize{axis}="([^"]*)"', description)
    return int(_number(found[1], f"Size{axis}", where, is_count=True)) if found else 1


def _shown(text: str) -> str:
    """On one line, and no longer than a line; letters that are not ASCII as Python has them, but for those of units."""
    short = text[:_SHOWN_CHARACTERS]
    return (short if short in _METRES else ascii(short)[1:-1]) + "..." * (len(text) > _SHOWN_CHARACTERS)


def _number(text: str, key: str, where: str, *, is_count: bool = False) -> float:
    """What `text`, the value of `key`, says: finite, and whole and positive where it counts pages."""
    value = float(text) if _NUMBER.fullmatch(text) else math.nan
    if math.isfinite(value) and (not is_count or (value.is_integer() and 1 <= value <= _MAX_COUNT)):
        return value
    raise InputError(
        "the description in this TIFF file has something else where a number belongs",
        where=where,
        got=f"{key}={_shown(text)}",
        expected=f"a whole number from 1 to {_MAX_COUNT}" if is_count else "a finite number",
        hint="save it again as a plain stack, all slices in one file",
    )
