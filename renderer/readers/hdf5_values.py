"""Turn the stored numbers of an HDF5 dataset into values, by the conventions of netCDF (CF).

Values are `stored * scale_factor + add_offset`; fill values, and what is not valid, are no data.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from renderer.readers.hdf5_objects import Dataset, numbers, text
from renderer.readers.scaled_values import scaled_type
from renderer.volume import Array, Float64, Label

# A value that is outside the valid ones by less than this part of their end is valid: attributes are rounded.
_MARGIN = 1e-5
# Attributes of the scale, and of the valid range.
_SCALES = ("scale_factor", "add_offset")
_VALID = ("valid_range", "valid_min", "valid_max")


class Values(NamedTuple):
    """The meaning of stored numbers.

    dtype: of the values. wrap: what is added to those below 0. scale, offset: by which they are multiplied, and what is
    added then. nodata: ranges of values, both ends included, that stand for no data. labels: by value. unit: of the
    values.
    """

    dtype: np.dtype[Any]
    wrap: float = 0.0
    scale: float = 1.0
    offset: float = 0.0
    nodata: tuple[tuple[float, float], ...] = ()
    labels: tuple[Label, ...] = ()
    unit: str = ""

    @property
    def is_scaled(self) -> bool:
        """Return whether values are other numbers than the stored ones, or than their bits without a sign."""
        return (self.scale, self.offset) != (1.0, 0.0)

    def of(self, stored: Array) -> Float64:
        """Return the values of stored numbers."""
        with np.errstate(over="ignore", invalid="ignore"):  # what becomes infinite is absent
            return np.asarray((np.where(stored < 0, self.wrap, 0.0) + stored) * self.scale + self.offset, np.float64)


def values_of(dataset: Dataset) -> Values:
    """Return the meaning of a dataset's numbers, by its attributes."""
    found = plain_values(dataset, is_unsigned=text(dataset, "_Unsigned").lower() == "true")
    scale, offset = ([*numbers(dataset, name), neutral][0] for name, neutral in zip(_SCALES, (1.0, 0.0), strict=True))
    found = scaled(found, scale, offset)
    return found._replace(nodata=tuple(_nodata(dataset, found)), unit=text(dataset, "units"))


def plain_values(dataset: Dataset, *, is_unsigned: bool = False) -> Values:
    """Return values that are the stored numbers. is_unsigned: whether their bits are numbers without a sign."""
    stored = dataset.dtype.newbyteorder("=")
    is_unsigned = is_unsigned and stored.kind == "i"
    dtype = np.dtype(f"u{stored.itemsize}") if is_unsigned or stored.kind == "b" else stored
    return Values(dtype, 2.0 ** (8 * stored.itemsize) if is_unsigned else 0.0)


def scaled(values: Values, scale: float, offset: float) -> Values:
    """Return values that are multiplied, and to which an offset is added, in a type of floats."""
    if (scale, offset) == (1.0, 0.0):
        return values
    return values._replace(dtype=scaled_type(values.dtype), scale=scale, offset=offset)


def unpacked_line(dataset: Dataset) -> Array:
    """Return the values of a dataset of coordinates."""
    values = values_of(dataset)
    stored: Array = dataset[...]
    return values.of(stored) if values.is_scaled or values.wrap else stored


def _nodata(dataset: Dataset, values: Values) -> Iterator[tuple[float, float]]:
    """Yield the ranges of values, both ends included, that stand for no data: fill values, and what is not valid."""
    fills = [*numbers(dataset, "_FillValue"), *numbers(dataset, "missing_value")]
    if dataset.dtype.itemsize > 1 and dataset.fillvalue != 0:  # what was not written; netCDF has none for bytes
        fills.append(float(dataset.fillvalue))
    for fill in values.of(np.unique(fills)).tolist():
        if math.isfinite(fill):
            yield fill, fill
    valid = numbers(dataset, "valid_range")
    least = [*valid[:1], *numbers(dataset, "valid_min"), -math.inf][0]
    largest = [*valid[1:2], *numbers(dataset, "valid_max"), math.inf][0]
    ends = np.array([least, largest])
    low, high = sorted((ends if _is_valid_unpacked(dataset) else values.of(ends)).tolist())
    if low > -math.inf:
        yield -math.inf, math.nextafter(low - _MARGIN * abs(low), -math.inf)
    if high < math.inf:
        yield math.nextafter(high + _MARGIN * abs(high), math.inf), math.inf


def _is_valid_unpacked(dataset: Dataset) -> bool:
    """Return whether the valid range is one of values, not of stored numbers.

    By the guide of netCDF it is if its type is that of the scale and wider than that of the stored numbers.
    """
    types = [np.asarray(dataset.attrs[name]).dtype for name in _SCALES if name in dataset.attrs]
    ranges = [np.asarray(dataset.attrs[name]).dtype for name in _VALID if name in dataset.attrs]
    widest = max((each for each in types if each.kind in "iuf"), key=lambda each: (each.kind == "f", each.itemsize),
                 default=dataset.dtype)  # fmt: skip
    is_wider = (widest.kind == "f", widest.itemsize) > (dataset.dtype.kind == "f", dataset.dtype.itemsize)
    return is_wider and bool(ranges) and all(each.newbyteorder("=") == widest.newbyteorder("=") for each in ranges)
