"""Read the fields of a DICOM file: their text, numbers, and those that tell frames at one place apart."""

from __future__ import annotations

import math
import re
from collections.abc import MutableSequence, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from renderer.errors import InputError

# A pydicom.Dataset.
Dataset = Any

# The functional groups that are needed: of lengths, place and values, and of what tells frames apart.
_GROUPS = (
    *("PixelMeasuresSequence", "PlanePositionSequence", "PlaneOrientationSequence", "PixelValueTransformationSequence"),
    *("FrameContentSequence", "MREchoSequence", "MRDiffusionSequence", "CardiacSynchronizationSequence"),
    *("SegmentIdentificationSequence", "TemporalPositionSequence", "RealWorldValueMappingSequence"),
    *("MRImageFrameTypeSequence", "CTImageFrameTypeSequence", "PETFrameTypeSequence"),
    *("PlanePositionVolumeSequence", "PlaneOrientationVolumeSequence"),  # of ultrasound
)
_DIRECTIONS = "DiffusionGradientDirectionSequence"


class Dimension(NamedTuple):
    """A dimension in which frames at one place differ, such as time.

    name: keywords of its fields, with `and` between them. axis: `t` for times and the like, `c` for others.
    is_order: it says which frame came first, and perhaps nothing else.
    """

    name: str
    axis: str
    is_order: bool = False


# What is there of a dimension in each frame: numbers, or text that is none. Marks are sorted.
Mark = tuple[list[float], str]

# Two dimensions part frames into volumes of their own: stacks, which may lie anywhere, and segments, which leave out
# empty slices.
STACK, SEGMENT = Dimension("StackID", "c"), Dimension("ReferencedSegmentNumber", "c")
IMAGE_TYPE = Dimension("ImageType", "c")
# Those that tell frames at one place apart, in the order in which they are tried.
_ORDERS = (
    *("FrameAcquisitionNumber", "AcquisitionNumber", "FrameAcquisitionDateTime", "AcquisitionDateTime"),
    *("AcquisitionTime", "ContentTime", "InstanceNumber"),  # of single slices, too
)
TOLD_APART = (
    *(STACK, SEGMENT, Dimension("TemporalPositionIdentifier", "t"), Dimension("TemporalPositionIndex", "t")),
    *(Dimension("EchoNumbers", "c"), Dimension("EffectiveEchoTime", "c"), Dimension("EchoTime", "c")),
    *(Dimension("DiffusionBValue and DiffusionGradientOrientation", "c"), Dimension("InversionTime", "c")),
    *(Dimension("NominalPercentageOfCardiacPhase", "t"), Dimension("NominalCardiacTriggerDelayTime", "t")),
    *(Dimension(keyword, "t") for keyword in ("TemporalPositionTimeOffset", "TriggerTime", "FrameReferenceTime")),
    *(Dimension("ComplexImageComponent", "c"), Dimension("FrameType", "c"), IMAGE_TYPE),
    *(Dimension(keyword, "t", is_order=True) for keyword in _ORDERS),
)
_TIMES = {each.name for each in TOLD_APART if each.axis == "t"}
# Those that tell when a frame was taken: their units, and whether they begin at midnight.
CLOCKS = {
    "FrameTime": ("ms", False),
    "TemporalPositionTimeOffset": ("s", False),
    **dict.fromkeys(("NominalCardiacTriggerDelayTime", "TriggerTime", "FrameReferenceTime"), ("ms", False)),
    **dict.fromkeys(("FrameAcquisitionDateTime", "AcquisitionDateTime", "AcquisitionTime"), ("s", True)),
}
# Of values, they say that there is none, or not which.
_NO_UNITS = ("", "US", "NONE", "NORMALIZED", "RELATIVE")
_CLOCK = re.compile(r"(?:[0-9]{8})?([0-9]{2})([0-9]{2})([0-9]{2}(?:\.[0-9]+)?)(?:[+-][0-9]{4})?\s*")
# Vectors of nuclear medicine have a number for each frame.
VECTORS = (
    *(Dimension("EnergyWindowVector", "c"), Dimension("DetectorVector", "c"), Dimension("PhaseVector", "t")),
    *(Dimension("RotationVector", "c"), Dimension("RRIntervalVector", "t"), Dimension("TimeSlotVector", "t")),
    *(Dimension("AngularViewVector", "c"), Dimension("TimeSliceVector", "t")),
)


def open_dicom(path: Path, *, with_pixels: bool = False) -> tuple[Dataset, bool]:
    """Return the fields before the pixels of a DICOM file, or all, and whether anything comes behind them.

    Raises InputError if it is damaged.
    """
    import pydicom

    try:
        with path.open("rb") as file:
            dataset = pydicom.dcmread(file, stop_before_pixels=not with_pixels, force=True)
            return dataset, bool(file.read(1))
    except Exception as error:  # of its parser, for damaged bytes
        hint = "a field of it is damaged: copy it again, or save it again"
        raise unreadable_slice(path, hint) from error


def unreadable_slice(path: Path, hint: str = "the file is truncated or damaged", got: str | None = None) -> InputError:
    """Return the error for a file that cannot be read."""
    return InputError("this DICOM slice cannot be read", where=str(path), got=got, hint=hint)


def text_of(fields: Sequence[Dataset], keyword: str) -> str:
    """Return the values of a field as text, as files list them, in the first of these datasets that has it; else
    nothing."""
    from pydicom.config import disable_value_validation
    from pydicom.datadict import tag_for_keyword

    tag = tag_for_keyword(keyword)
    found = next((each for each in fields if tag in each), None)
    if found is None:
        return ""
    try:
        with disable_value_validation():
            value = found[tag].value
    except Exception:  # of its parser, for damaged values
        value = found.get_item(tag).value.decode("latin-1")
    values = value if isinstance(value, MutableSequence) else [] if value is None else [value]
    return "\\".join(map(str, values))


def numbers_of(fields: Sequence[Dataset], keyword: str) -> list[float]:
    """Return the numbers of a field, in the first of these datasets that has it; as `_numbers_in` does."""
    return _numbers_in(text_of(fields, keyword))


def first_numbers(fields: Sequence[Dataset], keywords: Sequence[str], usual: list[float]) -> list[float]:
    """Return the numbers of the first of these fields that has as many as usual, or the usual ones."""
    found = (numbers_of(fields, keyword) for keyword in keywords)
    return next((numbers for numbers in found if len(numbers) == len(usual)), usual)


def _numbers_in(text: str) -> list[float]:
    """Return the numbers that a text lists; none if one of them is no number, or is not finite."""
    try:
        numbers = [float(word) for word in text.split("\\")] if text else []
    except ValueError:
        return []
    return numbers if all(map(math.isfinite, numbers)) else []


def groups_of(dataset: Dataset, keyword: str) -> list[list[Dataset]]:
    """Return for each item of a sequence of functional groups the datasets in the groups that are needed."""
    items = dataset[keyword].value if keyword in dataset else []
    found = [[item[group].value[0] for group in _GROUPS if group in item and item[group].value] for item in items]
    return [[*groups, *(group[_DIRECTIONS].value[0] for group in groups if _DIRECTIONS in group)] for groups in found]


def vectors_of(dataset: Dataset, count: int) -> dict[Dimension, list[float]]:
    """Return the vectors that have a number for each of `count` frames."""
    vectors = {each: numbers_of([dataset], each.name) for each in VECTORS}
    return {each: numbers for each, numbers in vectors.items() if len(numbers) == count}


def frame_marks(fields: Sequence[Dataset], dimensions: Sequence[Dimension]) -> dict[Dimension, Mark]:
    """Return what the fields say of one frame. dimensions: as `declared_dimensions` returns them."""
    indices = numbers_of(fields, "DimensionIndexValues")
    marks: dict[Dimension, Mark] = {each: ([k], "") for each, k in zip(dimensions, indices, strict=False)}
    for dimension in TOLD_APART:
        texts = [text_of(fields, keyword) for keyword in dimension.name.split(" and ")]
        if any(texts):
            numbers = [number for text in texts for number in _numbers_in(text)]
            marks.setdefault(dimension, (numbers, "" if numbers else "".join(texts)))
    return marks


def times_in(fields: Sequence[Dataset]) -> dict[str, float]:
    """Return the time of a frame by each of CLOCKS that it has."""
    times = {}
    for keyword, (_, is_clock) in CLOCKS.items():
        text = text_of(fields, keyword)
        clock = _CLOCK.fullmatch(text) if is_clock else None
        times[keyword] = [60 * (60 * int(clock[1]) + int(clock[2])) + float(clock[3])] if clock else []
        times[keyword] += [] if is_clock else _numbers_in(text)
    return {keyword: found[0] for keyword, found in times.items() if found}


def value_unit_in(fields: Sequence[Dataset], unit: str) -> str:
    """Return the unit of the values of a frame as rescaled. unit: where their scale tells it.

    Without a type, those of CT are HU.
    """
    given = [unit, *(text_of(fields, keyword).strip() for keyword in ("RescaleType", "Units", "DoseUnits"))]
    if not any(given) and text_of(fields, "Modality") == "CT" and text_of(fields, "RescaleIntercept"):
        given = ["HU"]
    return next((text for text in given if text.upper() not in _NO_UNITS), "")


def declared_dimensions(dataset: Dataset) -> list[Dimension]:
    """Return the dimensions that a file names, whose indices each of its frames has."""
    from pydicom.datadict import keyword_for_tag

    items = dataset.get("DimensionIndexSequence") or []
    names = [keyword_for_tag(item.get("DimensionIndexPointer", 0)) for item in items]
    return [Dimension(name or f"dimension {k + 1}", "t" if name in _TIMES else "c") for k, name in enumerate(names)]
