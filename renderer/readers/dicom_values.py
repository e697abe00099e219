"""Map the stored values of a DICOM frame to values: by a table, by slope and intercept, or to a real unit.

PS3.3: a Modality LUT Sequence takes the place of slope and intercept (C.11.1). A Real World Value Mapping has a slope
and an intercept of its own (C.7.6.16.2.11), which are used where the ordinary ones are 1 and 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.dicom_fields import Dataset, first_numbers, numbers_of, text_of, unreadable_slice
from renderer.volume import Array

# The keyword of the sequence with slope and intercept to a real unit.
_MAPPING = "RealWorldValueMappingSequence"
# The keyword of the sequence with the code of a real unit.
_UNIT = "MeasurementUnitsCodeSequence"
# The names of units whose codes in UCUM, the code system that DICOM uses, differ from the names.
_UNITS = {"[hnsf'U]": "HU", "1": ""}
# The Hounsfield units of air are at most this number.
_AIR = -700.0
# The largest relative difference between two slopes, or two intercepts, that count as equal.
_SAME = 1e-6


@dataclass(frozen=True)
class Table:
    """A table with the value of each stored value from `first` on.

    A stored value outside of the table has the value at the nearer end.
    """

    first: int
    values: Array


@dataclass(frozen=True)
class Scale:
    """A map from stored values to values.

    table: a table of values that takes the place of slope and intercept. dtype: the type of the values. padding: the
    first and last of the stored values that stand for no data. unit: the unit of the values, if the map itself states
    one. note: a remark on the map, or None.
    """

    slope: float
    intercept: float
    dtype: np.dtype[Any]
    table: Table | None = None
    padding: tuple[float, float] | None = None
    unit: str = ""
    note: str | None = None

    @property
    def nodata(self) -> tuple[float, float] | None:
        """Return the first and last of the values that stand for no data.

        Returns None if no values stand for no data, or if a table gives the values.
        """
        if self.padding is None or self.table is not None:
            return None
        low, high = sorted(end * self.slope + self.intercept for end in self.padding)
        return low, high

    def values_of(self, stored: Array, path: Path) -> Array:
        """Return the values of stored pixels; raises InputError for floats in a file whose header declares integers."""
        if stored.dtype.kind == "f" and self.dtype.kind != "f":
            raise unreadable_slice(path, "save it again without BitsStored", "floats with the fields of integers")
        if self.table is not None:
            last = len(self.table.values) - 1
            return np.take(self.table.values, np.clip(stored.astype(np.int64) - self.table.first, 0, last))
        if self.slope == 1.0 and self.intercept == 0.0:
            return stored
        return np.asarray(stored * self.slope + self.intercept).astype(self.dtype)


def scale_of(path: Path, fields: Sequence[Dataset], dataset: Dataset) -> Scale:
    """Return the map from stored values to values of a frame; raises InputError for a damaged table.

    fields: the functional groups of the frame, and the dataset.
    """
    padding = _padding(dataset)
    if (table := _modality_table(path, dataset)) is not None:
        unit = text_of(dataset.ModalityLUTSequence[:1], "ModalityLUTType")
        return Scale(1.0, 0.0, table.values.dtype, table, padding, unit)
    slope = first_numbers(fields, ["RescaleSlope", "DoseGridScaling"], [1.0])[0] or 1.0
    intercept, unit, note = first_numbers(fields, ["RescaleIntercept"], [0.0])[0], "", None
    maximum = numbers_of([dataset], "MaximumFractionalValue")
    if text_of([dataset], "SegmentationType") == "FRACTIONAL" and maximum and maximum[0] > 0:
        slope = 1.0 / maximum[0]
    pair = [*numbers_of(fields, "RealWorldValueSlope"), *numbers_of(fields, "RealWorldValueIntercept")]
    if len(pair) == 2 and pair[0] != 0.0:
        if (slope, intercept) == (1.0, 0.0):
            slope, intercept = pair
            unit = text_of([code for each in fields for code in (each.get(_UNIT) or [])[:1]][:1], "CodeValue")
        elif not np.allclose(pair, (slope, intercept), rtol=_SAME, atol=0.0):
            note = f"{_MAPPING}, another scale of the values, is not applied: RescaleSlope is"
    dtype = _rescaled_dtype(dataset, slope, intercept)
    return Scale(slope, intercept, dtype, None, padding, _UNITS.get(unit, unit), note)


def _modality_table(path: Path, dataset: Dataset) -> Table | None:
    """Return the table of values of a file; None if the file has none. Raises InputError for a damaged table."""
    if not dataset.get("ModalityLUTSequence"):
        return None
    item, is_little = dataset.ModalityLUTSequence[0], dataset.original_encoding[1] is not False
    descriptor, data = (_whole_numbers(item, keyword, is_little) for keyword in ("LUTDescriptor", "LUTData"))
    if len(descriptor) != 3 or not descriptor[2] % 2**16 <= 16:
        raise _table_error(path, f"LUTDescriptor = {text_of([item], 'LUTDescriptor')}")
    count, bits = int(descriptor[0]) % 2**16 or 2**16, int(descriptor[2])
    if bits <= 8 and len(data) in (count // 2, (count + 1) // 2) and len(data) < count:  # 16 bits hold two values
        data = np.array(data, "<u2" if is_little else ">u2").view(np.uint8)
    if len(data) < count:
        raise _table_error(path, f"{len(data)} of {count} values")
    first = as_stored(dataset, float(descriptor[1]))
    return Table(int(first), np.asarray(data[:count]).astype(np.uint8 if bits <= 8 else np.uint16))


def _whole_numbers(item: Dataset, keyword: str, is_little: bool) -> Array:
    """Return the unsigned integers of 16 bits in a field, whose value may be numbers or bytes."""
    value = item.get(keyword)
    if isinstance(value, bytes):
        return np.frombuffer(value[: len(value) // 2 * 2], "<u2" if is_little else ">u2")
    values = [] if value is None else [value] if isinstance(value, int) else list(value)
    return np.array(values, np.int64) % 2**16


def _table_error(path: Path, got: str) -> InputError:
    expected, hint = "a value for each number that LUTDescriptor counts", "the file is truncated or damaged"
    what = "the table of values of this DICOM file is damaged"
    return InputError(what, where=str(path), got=got, expected=expected, hint=hint)


def as_stored(dataset: Dataset, number: float) -> float:
    """Return a number of 16 bits with the sign that stored pixels have, whatever the type of the number's field."""
    return (number + 2**15) % 2**16 - 2**15 if dataset.get("PixelRepresentation") else number % 2**16


def has_value_of_air(dataset: Dataset, scale: Scale) -> bool:
    """Return whether a slope and an intercept give some stored value the Hounsfield units of air.

    Those of grey values that were made for display, such as 0 to 255, do not. A file without BitsStored stores floats.
    """
    if "BitsStored" not in dataset or scale.table is not None:
        return scale.table is None
    return min(end * scale.slope + scale.intercept for end in _stored_ends(dataset)) <= _AIR


def _padding(dataset: Dataset) -> tuple[float, float] | None:
    """Return the first and last of the stored grey values that stand for no data; None if there are none.

    A labelmap has none: its padding value is the background.
    """
    kind = next((kind for kind in ("Float", "DoubleFloat") if f"{kind}PixelPaddingValue" in dataset), "")
    ends = [*numbers_of([dataset], f"{kind}PixelPaddingValue"), *numbers_of([dataset], f"{kind}PixelPaddingRangeLimit")]
    is_gray = (text_of([dataset], "PhotometricInterpretation") or "MONOCHROME").startswith("MONOCHROME")
    if not ends or not is_gray or "SegmentSequence" in dataset:
        return None
    if not kind:
        ends = [as_stored(dataset, end) for end in ends]
    return min(ends), max(ends)


def _rescaled_dtype(dataset: Dataset, slope: float, intercept: float) -> np.dtype[Any]:
    """Return the dtype of rescaled values: sufficient integers for a whole slope and intercept, else floats.

    The integers are the smallest that suffice. A file without BitsStored stores floats.
    """
    bits, stored = _bits(dataset)
    if not 1 <= stored <= bits or bits not in (1, 8, 16, 32, 64):
        raise unreadable_slice(Path(dataset.filename), got=f"{stored} of {bits} bits")
    is_neutral = slope == 1.0 and intercept == 0.0
    if "BitsStored" not in dataset:
        return np.dtype("f4" if bits == 32 and is_neutral else "f8")
    if is_neutral:
        return np.dtype(f"{'i' if dataset.get('PixelRepresentation') else 'u'}{max(bits, 8) // 8}")
    low, high = sorted(end * slope + intercept for end in _stored_ends(dataset))
    if slope.is_integer() and intercept.is_integer() and max(-low, high) < 2**32:
        return np.min_scalar_type(int(high) if low >= 0 else int(min(low, -1 - high)))
    return np.dtype(np.float64)


def _bits(dataset: Dataset) -> tuple[int, int]:
    """Return how many bits a stored value has room for, and how many it uses."""
    return int(dataset.get("BitsAllocated") or 16), int(dataset.get("BitsStored") or 16)


def _stored_ends(dataset: Dataset) -> tuple[int, int]:
    """Return the lowest and the highest value that the stored integers of a file may have."""
    _, stored = _bits(dataset)
    return (-(2 ** (stored - 1)), 2 ** (stored - 1) - 1) if dataset.get("PixelRepresentation") else (0, 2**stored - 1)
