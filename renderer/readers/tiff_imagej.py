"""Read ImageJ's calibration of values and its origin from the description of a TIFF file."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from renderer.readers.statements import FormatTable, Statement
from renderer.readers.tiff_description import Page, imagej_fields
from renderer.system import number_in
from renderer.volume import Array, Float64

STATEMENTS = FormatTable(
    "TIFF of ImageJ",
    (
        Statement("slices", "meaning", "the number of slices; also channels and frames"),
        Statement("unit", "meaning", "the unit of lengths; also yunit and zunit"),
        Statement("spacing", "place", "the distance of slices"),
        Statement("xorigin", "place", "the index of the pixel at 0; also yorigin and zorigin"),
        Statement("finterval", "meaning", "the time between two frames, and its unit tunit"),
        Statement("c0", "values", "the calibration of values: a polynomial with c0, c1 and so on"),
        Statement("cf", "values", "a calibration by another kind of function", is_applied=False),
        Statement("vunit", "meaning", "the unit of calibrated values"),
        Statement("Ranges", "meaning", "the display range of each channel"),
        Statement("LUTs", "meaning", "the colours of channels"),
        Statement("Labels", "meaning", "the names of slices, and so of channels"),
    ),
)

# The number of coefficients of ImageJ's polynomials (Calibration, CurveFitter), by the number of the function: a
# straight line, and degrees 2 to 4.
_POLYNOMIALS = {0: 2, 1: 3, 2: 4, 3: 5}
# The number by which ImageJ states that there is no calibration.
_NO_FUNCTION = 20


class Calibration(NamedTuple):
    """A calibration: a polynomial that turns stored numbers into values.

    coefficients: the constant first; empty if values are the stored numbers. unit: the unit of the values. note: a
    remark on a function of another kind, which is not applied, or None.
    """

    coefficients: tuple[float, ...] = ()
    unit: str = ""
    note: str | None = None

    def dtype(self, stored: np.dtype[Any]) -> np.dtype[Any]:
        """Return the type of the values. stored: the type of stored numbers, which have at most 16 bits."""
        return np.dtype(np.float32) if self.coefficients else stored

    def apply(self, values: Array) -> None:
        """Replace stored numbers, in an array of floats, by values."""
        if self.coefficients:
            for plane in values:
                plane[...] = np.polynomial.polynomial.polyval(plane.astype(np.float64), self.coefficients)

    def of_ranges(self, ranges: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        """Return the ranges of values for ranges of stored numbers; without a calibration, the same ranges."""
        if not self.coefficients:
            return ranges
        ends = (np.polynomial.polynomial.polyval(np.array(pair), self.coefficients) for pair in ranges)
        return tuple((float(pair.min()), float(pair.max())) for pair in ends)


def find_calibration(page: Page) -> Calibration:
    """Return the calibration of a page; ImageJ has none for floats."""
    if page.dtype is None or page.dtype.kind != "u" or page.dtype.itemsize > 2:
        return Calibration()
    fields = imagej_fields(page.description)
    function = number_in(fields.get("cf"))
    if math.isnan(function) or function == _NO_FUNCTION:
        return Calibration()
    count = _POLYNOMIALS.get(int(function) if function.is_integer() else -1)
    found = [number_in(fields.get(f"c{k}")) for k in range(count or 0)]
    if count is None or not all(map(math.isfinite, found)):
        return Calibration(note=STATEMENTS.note({"cf"}))
    return Calibration(tuple(found) if found != [0, 1, 0, 0, 0][:count] else (), fields.get("vunit", ""))


def with_origin(world_from_index: Float64, page: Page) -> Float64:
    """Return the affine with ImageJ's origin: the pixel that lies at 0 in the world."""
    fields = imagej_fields(page.description)
    pixel = [number_in(fields.get(f"{axis}origin", "0")) for axis in "xyz"]
    if not any(pixel) or not np.isfinite([*pixel, *world_from_index.ravel()]).all():
        return world_from_index
    made = world_from_index.copy()
    made[:3, 3] -= made[:3, :3] @ np.array(pixel)
    return np.asarray(made + 0.0, np.float64)
