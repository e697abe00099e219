"""Read what ImageJ states of values and places in the description of a TIFF file: its calibration and its origin."""

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
        Statement("xorigin", "place", "the pixel at 0; also yorigin and zorigin"),
        Statement("finterval", "meaning", "the time between two frames, and its unit tunit"),
        Statement("c0", "values", "the calibration of values: a polynomial with c0, c1 and so on, where cf is 0 to 3"),
        Statement("cf", "values", "a function of another kind by which values are calibrated", is_applied=False),
        Statement("vunit", "meaning", "the unit of calibrated values"),
        Statement("Ranges", "meaning", "the display range of each channel"),
        Statement("LUTs", "meaning", "the colours of channels"),
        Statement("Labels", "meaning", "the names of slices, and so of channels"),
    ),
)

# Functions of ImageJ (Calibration, CurveFitter): a straight line, and polynomials of degree 2 to 4; and none.
_POLYNOMIALS = {0: 2, 1: 3, 2: 4, 3: 5}
_NO_FUNCTION = 20


class Calibration(NamedTuple):
    """A polynomial by which stored numbers become values: its coefficients, the constant first, and the unit.

    note: on a function of another kind, which is not applied.
    """

    coefficients: tuple[float, ...] = ()
    unit: str = ""
    note: str | None = None

    def dtype(self, stored: np.dtype[Any]) -> np.dtype[Any]:
        """Return the type of values of stored numbers of 16 bits or less."""
        return np.dtype(np.float32) if self.coefficients else stored

    def apply(self, values: Array) -> None:
        """Replace stored numbers, in a type of floats, by values."""
        if self.coefficients:
            for plane in values:
                plane[...] = np.polynomial.polynomial.polyval(plane.astype(np.float64), self.coefficients)

    def of_ranges(self, ranges: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        """Return ranges of values for ranges of stored numbers; without a calibration they are the same."""
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
    """Return the affine with the pixel at 0 that ImageJ states."""
    fields = imagej_fields(page.description)
    pixel = [number_in(fields.get(f"{axis}origin", "0")) for axis in "xyz"]
    if not any(pixel) or not np.isfinite([*pixel, *world_from_index.ravel()]).all():
        return world_from_index
    made = world_from_index.copy()
    made[:3, 3] -= made[:3, :3] @ np.array(pixel)
    return np.asarray(made + 0.0, np.float64)
