"""Turn the stored numbers of an HDF5 dataset into values, by the conventions of netCDF (CF).

Values are `stored * scale_factor + add_offset`. Fill values, and values outside of the valid range, are no data.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from renderer.readers.hdf5_objects import Dataset, numbers, text
from renderer.readers.scaled_values import scaled_type
from renderer.volume import Array, Float64, Label

# Each end of the valid range is moved outwards by this share of its value, as attributes are rounded.
_MARGIN = 1e-5
# The attributes with the factor and the offset that turn stored numbers into values.
_SCALES = ("scale_factor", "add_offset")
# The attributes with the valid range: numbers outside of the range stand for no data.
_VALID = ("valid_range", "valid_min", "valid_max")


class Values(NamedTuple):
    """The meaning of stored numbers: how they become values, and which values stand for no data.

    dtype: the type of the values.
    wrap: the number that is added to negative stored numbers, before scale and offset, if their bits are unsigned.
    scale, offset: the factor that is applied, and the number that is added after it.
    nodata: the ranges of values, both ends included, that stand for no data.
    labels: the labels that the values stand for.
    unit: the unit of the values.
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
        """Return whether scale or offset change the stored numbers."""
        return (self.scale, self.offset) != (1.0, 0.0)

    def of(self, stored: Array) -> Float64:
        """Return the values of stored numbers."""
        with np.errstate(over="ignore", invalid="ignore"):  # infinite values stand for no data
            return np.asarray((np.where(stored < 0, self.wrap, 0.0) + stored) * self.scale + self.offset, np.float64)


def values_of(dataset: Dataset) -> Values:
    """Return the meaning of a dataset's numbers, by its attributes."""
    found = plain_values(dataset, is_unsigned=text(dataset, "_Unsigned").lower() == "true")
    scale, offset = ([*numbers(dataset, name), neutral][0] for name, neutral in zip(_SCALES, (1.0, 0.0), strict=True))
    found = scaled(found, scale, offset)
    return found._replace(nodata=tuple(_nodata(dataset, found)), unit=text(dataset, "units"))


def plain_values(dataset: Dataset, *, is_unsigned: bool = False) -> Values:
    """Return the meaning of stored numbers that are used as they are. is_unsigned: whether their bits are unsigned."""
    stored = dataset.dtype.newbyteorder("=")
    is_unsigned = is_unsigned and stored.kind == "i"
    dtype = np.dtype(f"u{stored.itemsize}") if is_unsigned or stored.kind == "b" else stored
    return Values(dtype, 2.0 ** (8 * stored.itemsize) if is_unsigned else 0.0)


def scaled(values: Values, scale: float, offset: float) -> Values:
    """Return the meaning of stored numbers that a scale and an offset turn into floats."""
    if (scale, offset) == (1.0, 0.0):
        return values
    return values._replace(dtype=scaled_type(values.dtype), scale=scale, offset=offset)


def unpacked_line(dataset: Dataset) -> Array:
    """Return the values of a dataset of coordinates."""
    values = values_of(dataset)
    stored: Array = dataset[...]
    return values.of(stored) if values.is_scaled or values.wrap else stored


def _nodata(dataset: Dataset, values: Values) -> Iterator[tuple[float, float]]:
    """Yield the ranges of values, both ends included, that stand for no data: fill values and invalid values."""
    fills = [*numbers(dataset, "_FillValue"), *numbers(dataset, "missing_value")]
    # The fill value of HDF5 stands for voxels that were not written. In netCDF, values of one byte have no
    # fill value.
    if dataset.dtype.itemsize > 1 and dataset.fillvalue != 0:
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
    """Return whether the valid range applies to values rather than to stored numbers.

    By netCDF's guide, it applies to values if it has the type of the scale, and a wider type than the stored numbers.
    """
    types = [np.asarray(dataset.attrs[name]).dtype for name in _SCALES if name in dataset.attrs]
    ranges = [np.asarray(dataset.attrs[name]).dtype for name in _VALID if name in dataset.attrs]
    widest = max((each for each in types if each.kind in "iuf"), key=lambda each: (each.kind == "f", each.itemsize),
                 default=dataset.dtype)  # fmt: skip
    is_wider = (widest.kind == "f", widest.itemsize) > (dataset.dtype.kind == "f", dataset.dtype.itemsize)
    return is_wider and bool(ranges) and all(each.newbyteorder("=") == widest.newbyteorder("=") for each in ranges)
