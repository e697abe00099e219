"""Read axes and spacing from the descriptions that ImageJ and OME write into the first page of a TIFF file.

ImageJ's is lines of `key=value`. OME's is XML, in which a few attributes are searched as text: nothing is parsed,
expanded or nested.
"""

from __future__ import annotations

import html
import math
import re
import unicodedata
from fractions import Fraction

from renderer.errors import InputError
from renderer.readers.text_header import NUMBER

_MAX_COUNT = 2**31 - 1
_SHOWN_CHARACTERS = 40

_PIXELS = re.compile(r"<(?:\w+:)?Pixels\b[^<>]*>")

# OME's units of length (OME 2016-06, UnitsLength) that can be converted. `pixel`, `reference frame` and unknown units
# cannot; without a unit it is µm.
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

# The units of the resolution by number, and their lengths in mm.
_UNITS_OF_TAG = {2: "inch", 3: "cm"}
MM_PER_UNIT = {2: 25.4, 3: 10.0}
# Spellings of units in ImageJ; pixels are not a unit.
_MICRON = unicodedata.normalize("NFKC", "µm")
_NAMES_OF_UNITS = dict.fromkeys(("um", _MICRON, "micron", "microns", "micrometer", "micrometers"), _MICRON)
_NAMES_OF_UNITS |= dict.fromkeys(("in", "inch", "inches"), "inch") | dict.fromkeys(("pixel", "pixels"), "")
_NAMES_OF_UNITS |= dict.fromkeys(("cm", "centimeter", "centimeters"), "cm")


def is_imagej(description: str) -> bool:
    """Return whether ImageJ wrote the description."""
    return description.startswith("ImageJ=")


def is_ome(description: str) -> bool:
    """Return whether the description is OME's XML."""
    return "<OME" in description


def hyperstack(description: str, num_pages: int, num_samples: int) -> tuple[str, list[int]]:
    """Return the axes of the pages from slowest to fastest, a permutation of `TZC`, and the length of each.

    num_samples: of a pixel; OME counts them as channels.
    Raises InputError if the description does not fit the number of pages, or has no numbers where they belong.
    """
    if is_imagej(description):
        axes = "TZC"
        frames, channels = (_line(description, key) or 1 for key in ("frames", "channels"))
        images, slices = (_line(description, key) for key in ("images", "slices"))
        from_images = images // (frames * channels) if images else num_pages
        by_axis = {"T": frames, "C": channels, "Z": slices or from_images}
    elif is_ome(description):
        pixels = _pixels(description)
        order = _attribute(pixels, "DimensionOrder") or ""
        axes = order[:1:-1] if order[:2] == "XY" and sorted(order[2:]) == ["C", "T", "Z"] else "TZC"
        sizes = {axis: _attribute(pixels, f"Size{axis}") for axis in "TZC"}
        by_axis = {axis: int(_number("1" if text is None else text, f"Size{axis}", 1)) for axis, text in sizes.items()}
        if by_axis["C"] % num_samples == 0:
            by_axis["C"] //= num_samples
    else:
        return "TZC", [1, num_pages, 1]
    counts = [by_axis[axis] for axis in axes]
    if math.prod(counts) != num_pages:
        raise InputError(
            "the description in this TIFF file does not fit its pages",
            got=f"{num_pages} pages",
            expected=" x ".join(f"{by_axis[axis]} {axis}" for axis in axes),
            hint="save it again as a plain stack, all slices in one file",
        )
    return axes, counts


def ome_page_order(description: str, axes: str, counts: list[int]) -> list[int]:
    """Return the number of the page of each plane, planes in the order of `axes` and `counts`, as in `hyperstack`.

    TiffData elements may place planes on any page. Raises InputError unless each plane has a page of its own.
    """
    order = list(range(math.prod(counts)))
    for element in re.findall(r"<(?:\w+:)?TiffData\b[^<>]*>", description):
        found = {
            name: int(_number(text, name, least=0))
            for name in ("IFD", "PlaneCount", "FirstT", "FirstZ", "FirstC")
            if (text := _attribute(element, name)) is not None
        }
        plane = 0
        for axis, count in zip(axes, counts, strict=True):
            plane = plane * count + found.get(f"First{axis}", 0)
        if "IFD" in found:
            for k in range(min(found.get("PlaneCount", 1), len(order) - plane)):
                order[plane + k] = found["IFD"] + k
    if sorted(order) != list(range(len(order))):
        raise InputError(
            "the description in this TIFF file does not give each plane a page",
            expected=f"TiffData elements for {len(order)} pages, all in this file",
            hint="save it again as a plain stack, all slices in one file",
        )
    return order


def _attribute(element: str, name: str) -> str | None:
    """Return the text of an attribute of an XML element, in either kind of quotes; None if it is missing."""
    found = re.search(rf"""\b{name}\s*=\s*(?:"([^"]*)"|'([^']*)')""", element)
    return None if found is None else found[1] if found[1] is not None else found[2]


def imagej_spacing(description: str, sizes: list[float | None], tag: int | None) -> list[float | None]:
    """Return the spacing along x, y and z; None for an axis without one.

    Lengths are in the unit of ImageJ's description, or in mm if the resolution is per inch or cm.
    sizes: of x and y, from the resolution. tag: the number of its unit; None if that field is missing. Sizes per cm
        with a unit of µm are converted, as ImageJ does. Raises InputError for other units with inch and cm, which
        ImageJ, but no other program, takes for the unit of x and y, and for a spacing that is not a number.
    """
    step = re.search(r"^spacing=([0-9.eE+-]+)", description, re.M)  # words such as NaN mean that it is unknown
    z = abs(_number(step[1], "spacing")) if step else None  # 0 does, too
    units = {axis: _imagej_unit(description, key) for axis, key in zip("xyz", ("unit", "yunit", "zunit"), strict=True)}
    unit = units["x"]
    others = [name for name in (units["y"], units["z"]) if name not in ("", unit)]
    if tag is None and not unit:
        tag = 2  # as TIFF has it
    per = _UNITS_OF_TAG.get(tag or 0, "")
    x, y = sizes
    if not others and per == "cm" and unit == _MICRON:
        return [x and x * 1e4, y and y * 1e4, z]
    if others or (per and unit not in ("", per)):
        raise InputError(
            "the voxel sizes in this TIFF file are in units that cannot be compared",
            got=f"pixels per {per}; " * bool(per)
            + ", ".join(f"{axis} in {_shown(units[axis]) or unit}" for axis in units),
            expected="one unit for all, or pixels per cm and unit=um",
            hint="`spacing: [x, y, z]` replaces the spacing in the file",
        )
    factor = MM_PER_UNIT[tag] if tag and per else 1.0
    return [size and size * factor for size in (x, y, z)]


def _imagej_unit(description: str, key: str) -> str:
    """Return the unit of an ImageJ line, by one name for all spellings; empty for pixels and for no unit."""
    found = re.search(rf"^{key}=(.*)$", description, re.M)
    text = re.sub(r"\\u([0-9a-fA-F]{4})", lambda code: chr(int(code[1], 16)), found[1]) if found else ""
    name = unicodedata.normalize("NFKC", text.replace("\ufffdm", "µm").strip())
    return _NAMES_OF_UNITS.get(name.lower(), name)


def ome_spacing(description: str) -> list[float | None]:
    """Return the spacing along x, y and z in the unit of the first one; None for an axis without one.

    Raises InputError for a spacing that is not a number, and for units that cannot be converted to each other.
    """
    attributes = _pixels(description)
    found = {axis: _attribute(attributes, f"PhysicalSize{axis}") for axis in "XYZ"}
    given = {
        axis: _number(text, f"PhysicalSize{axis}")
        for axis, text in found.items()
        if text and not text.strip("0123456789.eE+-")  # words mean that it is unknown
    }
    sizes = {axis: size for axis, size in given.items() if size}  # 0 if it is unknown
    units = {axis: _unit(attributes, axis) for axis in sizes}
    first = next(iter(units.values()), "")
    if any(unit != first and not {unit, first} <= _METRES.keys() for unit in units.values()):
        raise InputError(
            "the voxel sizes in this TIFF file are in units that cannot be compared",
            got=", ".join(f"PhysicalSize{axis}={sizes[axis]:g} {_shown(units[axis])}" for axis in sizes),
            expected="one unit for all, or units of length such as nm, µm and mm",
            hint="`spacing: [x, y, z]` replaces the spacing in the file",
        )
    return [_converted(sizes[axis], units[axis], first) if axis in sizes else None for axis in "XYZ"]


def _unit(attributes: str, axis: str) -> str:
    """Return the unit of a PhysicalSize, in one of its Unicode spellings."""
    found = _attribute(attributes, f"PhysicalSize{axis}Unit")
    # A Latin-1 file read as UTF-8 has a replacement character for its only letter outside ASCII.
    text = "µm" if found is None else html.unescape(found).replace("\ufffdm", "µm").replace("\ufffd", "Å")
    return unicodedata.normalize("NFKC", text.strip())


def _converted(size: float, unit: str, into: str) -> float:
    """Return a size in another unit, rounded once; infinite if it overflows."""
    if unit == into:
        return size
    try:
        return float(Fraction(size) * _METRES[unit] / _METRES[into])
    except OverflowError:
        return math.inf


def _line(description: str, key: str) -> int | None:
    found = re.search(rf"^{key}=(\S*)", description, re.M)
    return int(_number(found[1], key, least=1)) if found else None


def _pixels(description: str) -> str:
    """Return the first Pixels element of OME's XML, without what is inside it; all of the XML if there is none."""
    found = _PIXELS.search(description)
    return found[0] if found else description


def _shown(text: str) -> str:
    """Return text for one line of a message; letters outside ASCII are escaped, except those of units."""
    short = text[:_SHOWN_CHARACTERS]
    return (short if short in _METRES else ascii(short)[1:-1]) + "..." * (len(text) > _SHOWN_CHARACTERS)


def _number(text: str, key: str, least: int | None = None) -> float:
    """Return the number that `text`, the value of `key`, spells: a finite one, or a whole one from `least` on."""
    value = float(text) if NUMBER.fullmatch(text) else math.nan
    if math.isfinite(value) if least is None else value.is_integer() and least <= value <= _MAX_COUNT:
        return value
    raise InputError(
        "the description in this TIFF file has something else where a number belongs",
        got=f"{key}={_shown(text)}",
        expected="a finite number" if least is None else f"a whole number from {least} to {_MAX_COUNT}",
        hint="save it again as a plain stack, all slices in one file",
    )
