"""Find the lengths of voxels in a TIFF file: in descriptions of ImageJ, OME and tifffile, by Zeiss, or by resolution.

ImageJ writes no `spacing` if slices are 1 unit apart. A missing length is taken from x, and a note says so. The usual
pixels per inch of a screen or printer are not lengths.
"""

from __future__ import annotations

import math
import re
import unicodedata
from fractions import Fraction
from typing import Any

from renderer.errors import InputError
from renderer.readers.affines import GUESSED_LENGTHS, no_spacing
from renderer.readers.tiff_description import escaped, is_imagej, is_ome, number, ome_pixels, shaped_fields
from renderer.readers.tiff_statements import records_of
from renderer.readers.units import are_of_screen, one_spelling
from renderer.system import attribute, unescaped

# The number of the field XResolution: pixels per unit of length along x.
_X_RESOLUTION = 282
# The number of the field YResolution: pixels per unit of length along y.
_Y_RESOLUTION = 283
# The number of the field ResolutionUnit: the unit of the resolution.
_RESOLUTION_UNIT = 296
# The number of the field ModelPixelScaleTag: the size of pixels on a map (GeoTIFF).
_PIXEL_SCALE = 33550

# The power of ten for each prefix of the metre in OME's units of length (OME 2016-06, UnitsLength).
_PREFIXES = {"Y": 24, "Z": 21, "E": 18, "P": 15, "T": 12, "G": 9, "M": 6, "k": 3, "h": 2, "da": 1, "": 0, "d": -1}
_PREFIXES |= {"c": -2, "m": -3, "µ": -6, "n": -9, "p": -12, "f": -15, "a": -18, "z": -21, "y": -24}
# An inch in metres.
_INCH = Fraction(254, 10_000)
# The lengths in metres of OME's units that are not the metre with a prefix.
_OTHERS = {"Å": Fraction(1, 10**10), "thou": _INCH / 1000, "pt": _INCH / 72, "li": _INCH / 12, "in": _INCH}
_OTHERS |= {"ft": _INCH * 12, "yd": _INCH * 36, "mi": _INCH * 63_360, "ua": Fraction(149_597_870_700)}
_OTHERS |= {"ly": Fraction(9_460_730_472_580_800), "pc": Fraction(149_597_870_700 * 648_000 / math.pi)}
# The lengths in metres of all units of OME that can be converted. `pixel`, `reference frame` and unknown units cannot.
_METRES = {f"{prefix}m": Fraction(10) ** power for prefix, power in _PREFIXES.items()} | _OTHERS
_METRES = {unicodedata.normalize("NFKC", unit): metres for unit, metres in _METRES.items()}

# The unit of the resolution, by the number in the field ResolutionUnit.
_UNITS_OF_TAG = {2: "inch", 3: "cm"}
# The length in mm of the unit of the resolution, by the number in the field ResolutionUnit.
_MM_PER_UNIT = {2: 25.4, 3: 10.0}
# The micrometre, in the Unicode spelling in which units are compared.
_MICRON = unicodedata.normalize("NFKC", "µm")


def find_spacing(first: Any) -> tuple[list[float], str, str | None]:
    """Return the spacing along x, y and z, its unit, and a note on guessed lengths.

    first: the first page of a file. Lengths are in the unit of the description (µm for Zeiss), or in mm if there is
    only a resolution per inch or cm. A missing length is taken from x, or is 1. Raises InputError for lengths that are
    not numbers, or that are in units that cannot be compared.
    """
    given, unit = _given_spacing(first)
    x = given[0] or 1.0
    missing = [axis for axis, size in zip("xyz", given, strict=True) if not size]
    note = f"{GUESSED_LENGTHS} along {' and '.join(missing)}; {'that along x' if given[0] else '1'} is assumed"
    spacing = [x, given[1] or x, given[2] or x]
    if len(missing) == 3:
        return spacing, "", no_spacing(records_of(first))
    return spacing, unit, note if missing else None


def _given_spacing(first: Any) -> tuple[list[float | None], str]:
    """Return the lengths that the file gives along x, y and z, and their unit."""
    description = first.description
    sizes = [_pixel_size(first, tag) for tag in (_X_RESOLUTION, _Y_RESOLUTION)]
    tag = value if isinstance(value := first.tags.valueof(_RESOLUTION_UNIT), int) else None
    if is_ome(description):
        return _ome_spacing(description)
    if first.is_lsm:
        return [abs(float(first.parent.lsm_metadata[f"VoxelSize{axis}"])) * 1e6 for axis in "XYZ"], "µm"
    scale = first.tags.valueof(_PIXEL_SCALE)
    if isinstance(scale, tuple) and len(scale) == 3 and all(0 < size < math.inf for size in scale[:2]):
        return [float(scale[0]), float(scale[1]), float(scale[2]) if 0 < scale[2] < math.inf else None], ""
    fields = shaped_fields(first)
    if not is_imagej(description):
        keys = [key for key in ("unit", "yunit", "zunit", "spacing") if fields.get(key) is not None]
        description = "\n".join(f"{key}={fields[key]}" for key in keys)
        tag = 1 if tag == 2 and keys else tag  # tifffile writes inch if it is not told the unit of the resolution
    unit = _imagej_unit(description, "unit")
    mm = _MM_PER_UNIT.get(2 if tag is None and not unit else tag or 0)
    per_inch = [25.4 / (size * mm) for size in sizes if size and mm]
    is_screen = are_of_screen(per_inch)
    if is_screen and not unit:  # ImageJ ignores 72 pixels per inch, too
        sizes, tag = [1.0, 1.0], 1
    is_said = bool(unit) and not is_screen
    if is_imagej(description) and (is_said or (tag == 1 and sizes not in ([1, 1], [None, None]))):
        # ImageJ writes no line for slices 1 unit apart, and none for a single slice.
        counts = re.findall(r"^(?:images|slices)=(.*)", description, re.M)
        is_left_out = any(count.strip() != "1" for count in counts) and "\nspacing=" not in description
        description += "\nspacing=1" * is_left_out
    if is_said or re.search(r"^spacing=", description, re.M):
        return _imagej_spacing(description, sizes, tag)
    return [*(None if is_screen else size and mm and size * mm for size in sizes), None], "mm"


def _pixel_size(page: Any, tag: int) -> float | None:
    """Return the length of a pixel, the inverse of the resolution, which is a fraction; None without a resolution."""
    fraction: Any = page.tags.valueof(tag)
    if not (isinstance(fraction, tuple) and len(fraction) == 2 and all(fraction)):
        return None
    return float(fraction[1] / fraction[0])


def _imagej_spacing(description: str, sizes: list[float | None], tag: int | None) -> tuple[list[float | None], str]:
    """Return the spacing along x, y and z, None for an axis without one, and the unit.

    Lengths are in the unit of ImageJ's description, or in mm if the resolution is per inch or cm.

    sizes: the lengths of a pixel along x and y, from the resolution. tag: the number of the unit of the resolution, or
        None if that field is missing. Pixels per cm with a unit of µm are converted, as in ImageJ. Raises InputError
        for other units together with inch or cm, as ImageJ uses them for x and y but other programs do not, and for a
        spacing that is not a number.
    """
    step = re.search(r"^spacing=([0-9.eE+-]+)", description, re.M)  # words such as NaN stand for an unknown spacing
    z = (abs(number(step[1], "spacing")) or 1.0) if step else None  # ImageJ takes 0 for 1
    units = {axis: _imagej_unit(description, key) for axis, key in zip("xyz", ("unit", "yunit", "zunit"), strict=True)}
    unit = units["x"]
    others = [name for name in (units["y"], units["z"]) if name not in ("", unit)]
    if tag is None and not unit:
        tag = 2  # inch, the default of TIFF
    per = _UNITS_OF_TAG.get(tag or 0, "")
    x, y = sizes
    if not others and per == "cm" and unit == _MICRON:
        return [x and x * 1e4, y and y * 1e4, z], unit
    if others or (per and unit not in ("", per)):
        shown = ", ".join(f"{axis} in {_unit_shown(units[axis]) or unit}" for axis in units)
        raise _units_error(f"pixels per {per}; " * bool(per) + shown, "or pixels per cm and unit=um")
    factor = _MM_PER_UNIT[tag] if tag and per else 1.0
    return [size and size * factor for size in (x, y, z)], "mm" if per else unit


def _imagej_unit(description: str, key: str) -> str:
    """Return the unit in a line of ImageJ, in one spelling; an empty text for pixels and for no unit."""
    found = re.search(rf"^{key}=(.*)$", description, re.M)
    text = re.sub(r"\\u([0-9a-fA-F]{4})", lambda code: chr(int(code[1], 16)), found[1]) if found else ""
    return unicodedata.normalize("NFKC", one_spelling(text.replace("\ufffdm", "µm")))


def _ome_spacing(description: str) -> tuple[list[float | None], str]:
    """Return the spacing along x, y and z, None for an axis without one, and the unit of the first axis.

    Raises InputError for a spacing that is not a number, and for units that cannot be converted to each other.
    """
    attributes = ome_pixels(description)
    found = {axis: attribute(attributes, f"PhysicalSize{axis}") for axis in "XYZ"}
    given = {
        axis: number(text, f"PhysicalSize{axis}")
        for axis, text in found.items()
        if text and not text.strip("0123456789.eE+-")  # words stand for an unknown spacing
    }
    sizes = {axis: size for axis, size in given.items() if size}  # 0 stands for an unknown size
    units = {axis: _unit(attributes, axis) for axis in sizes}
    first = next(iter(units.values()), "")
    if any(unit != first and not {unit, first} <= _METRES.keys() for unit in units.values()):
        shown = ", ".join(f"PhysicalSize{axis}={sizes[axis]:g} {_unit_shown(units[axis])}" for axis in sizes)
        raise _units_error(shown, "or units of length such as nm, µm and mm")
    return [_converted(sizes[axis], units[axis], first) if axis in sizes else None for axis in "XYZ"], first


def _unit(attributes: str, axis: str) -> str:
    """Return the unit of a PhysicalSize in its normalised Unicode spelling."""
    found = attribute(attributes, f"PhysicalSize{axis}Unit")
    # A Latin-1 file read as UTF-8 has a replacement character for its only letter outside ASCII.
    text = "µm" if found is None else unescaped(found).replace("\ufffdm", "µm").replace("\ufffd", "Å")
    return unicodedata.normalize("NFKC", text.strip())


def _converted(size: float, unit: str, into: str) -> float:
    """Return a size in another unit, rounded once; infinite if it overflows."""
    if unit == into:
        return size
    try:
        return float(Fraction(size) * _METRES[unit] / _METRES[into])
    except OverflowError:
        return math.inf


def _units_error(got: str, others: str) -> InputError:
    what, hint = "are in units that cannot be compared", "`spacing: [x, y, z]` replaces the spacing in the file"
    return InputError(
        f"the voxel sizes in this TIFF file {what}", got=got, expected=f"one unit for all, {others}", hint=hint
    )


def _unit_shown(unit: str) -> str:
    return unit if unit in _METRES else escaped(unit)
