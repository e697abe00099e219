"""Read the fields of a DICOM file as text or numbers, and the dimensions that distinguish frames at one place."""

from __future__ import annotations

import math
import re
from collections.abc import MutableSequence, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from renderer.errors import InputError

# The fields of a DICOM file, or of an item of a sequence: a pydicom.Dataset.
Dataset = Any

# The functional groups (sequences with the fields of a frame) that are read for lengths, places and values, and to
# distinguish frames at one place.
_GROUPS = (
    "PixelMeasuresSequence",
    "PlanePositionSequence",
    "PlaneOrientationSequence",
    "PixelValueTransformationSequence",
    "FrameContentSequence",
    "MREchoSequence",
    "MRDiffusionSequence",
    "CardiacSynchronizationSequence",
    "SegmentIdentificationSequence",
    "TemporalPositionSequence",
    "RealWorldValueMappingSequence",
    "MRImageFrameTypeSequence",
    "CTImageFrameTypeSequence",
    "PETFrameTypeSequence",
    "PlanePositionVolumeSequence",  # ultrasound
    "PlaneOrientationVolumeSequence",  # ultrasound
)

# The sequence inside of a functional group that holds the direction of a diffusion gradient.
_DIRECTIONS = "DiffusionGradientDirectionSequence"


class Dimension(NamedTuple):
    """A dimension: a property, such as time, in which frames at one place may differ.

    name: the keywords of the fields that hold the property, with `and` between them. axis: `t` if the values are times
    or phases, `c` if they distinguish components. is_order: whether the values may say no more than the order in which
    frames were taken.
    """

    name: str
    axis: str
    is_order: bool = False


# The value of a dimension in a frame: its numbers, or its text where it has no numbers. Marks can be sorted.
Mark = tuple[list[float], str]

# The dimension of stacks. Each stack is a volume of its own, which may lie anywhere.
STACK = Dimension("StackID", "c")

# The dimension of segments. Each segment is a volume of its own, which may leave out empty slices.
SEGMENT = Dimension("ReferencedSegmentNumber", "c")

# The dimension of kinds of images, such as magnitude and phase.
IMAGE_TYPE = Dimension("ImageType", "c")

# Fields with the order in which frames were taken. Files of a single slice have such fields, too.
_ORDERS = (
    "FrameAcquisitionNumber",
    "AcquisitionNumber",
    "FrameAcquisitionDateTime",
    "AcquisitionDateTime",
    "AcquisitionTime",
    "ContentTime",
    "InstanceNumber",
)

# The dimensions that distinguish frames at one place, in the order in which they are tried.
TOLD_APART = (
    STACK,
    SEGMENT,
    Dimension("TemporalPositionIdentifier", "t"),
    Dimension("TemporalPositionIndex", "t"),
    Dimension("EchoNumbers", "c"),
    Dimension("EffectiveEchoTime", "c"),
    Dimension("EchoTime", "c"),
    Dimension("DiffusionBValue and DiffusionGradientOrientation", "c"),
    Dimension("InversionTime", "c"),
    Dimension("NominalPercentageOfCardiacPhase", "t"),
    Dimension("NominalCardiacTriggerDelayTime", "t"),
    Dimension("TemporalPositionTimeOffset", "t"),
    Dimension("TriggerTime", "t"),
    Dimension("FrameReferenceTime", "t"),
    Dimension("ComplexImageComponent", "c"),
    Dimension("FrameType", "c"),
    IMAGE_TYPE,
    *(Dimension(keyword, "t", is_order=True) for keyword in _ORDERS),
)

# The names of the dimensions whose values are times or phases.
_TIMES = {each.name for each in TOLD_APART if each.axis == "t"}

# For each field that holds the time of a frame: the unit of the time, and whether it is a time of day.
CLOCKS = {
    "FrameTime": ("ms", False),
    "TemporalPositionTimeOffset": ("s", False),
    **dict.fromkeys(("NominalCardiacTriggerDelayTime", "TriggerTime", "FrameReferenceTime"), ("ms", False)),
    **dict.fromkeys(("FrameAcquisitionDateTime", "AcquisitionDateTime", "AcquisitionTime"), ("s", True)),
}
# The texts, in capitals, that a field holds if values have no unit or an unknown one.
_NO_UNITS = ("", "US", "NONE", "NORMALIZED", "RELATIVE")
# A date and time, or a time of day alone. The groups are hours, minutes and seconds.
_CLOCK = re.compile(r"(?:[0-9]{8})?([0-9]{2})([0-9]{2})([0-9]{2}(?:\.[0-9]+)?)(?:[+-][0-9]{4})?\s*")

# The fields of nuclear medicine that are vectors with a number for each frame.
VECTORS = (
    Dimension("EnergyWindowVector", "c"),
    Dimension("DetectorVector", "c"),
    Dimension("PhaseVector", "t"),
    Dimension("RotationVector", "c"),
    Dimension("RRIntervalVector", "t"),
    Dimension("TimeSlotVector", "t"),
    Dimension("AngularViewVector", "c"),
    Dimension("TimeSliceVector", "t"),
)


def open_dicom(path: Path, *, with_pixels: bool = False) -> tuple[Dataset, bool]:
    """Return the fields before the pixels of a DICOM file, or all fields, and whether more bytes follow them.

    with_pixels: whether all fields are returned. Raises InputError if the file is damaged.
    """
    import pydicom

    try:
        with path.open("rb") as file:
            dataset = pydicom.dcmread(file, stop_before_pixels=not with_pixels, force=True)
            return dataset, bool(file.read(1))
    except Exception as error:  # pydicom raises any exception for damaged bytes
        hint = "a field of it is damaged: copy it again, or save it again"
        raise unreadable_slice(path, hint) from error


def unreadable_slice(path: Path, hint: str = "the file is truncated or damaged", got: str | None = None) -> InputError:
    """Return the error for a DICOM file that cannot be read. got: what was found in the file, or None."""
    return InputError("this DICOM slice cannot be read", where=str(path), got=got, hint=hint)


def text_of(fields: Sequence[Dataset], keyword: str) -> str:
    """Return the values of a field as text, joined by backslashes, from the first of the datasets that has the field.

    Returns an empty text if no dataset has the field.
    """
    from pydicom.config import disable_value_validation
    from pydicom.datadict import tag_for_keyword

    tag = tag_for_keyword(keyword)
    found = next((each for each in fields if tag in each), None)
    if found is None:
        return ""
    try:
        with disable_value_validation():
            value = found[tag].value
    except Exception:  # pydicom raises any exception for damaged values
        value = found.get_item(tag).value.decode("latin-1")
    values = value if isinstance(value, MutableSequence) else [] if value is None else [value]
    return "\\".join(map(str, values))


def numbers_of(fields: Sequence[Dataset], keyword: str) -> list[float]:
    """Return the numbers of a field from the first dataset that has it; an empty list if a value is not a number."""
    return _numbers_in(text_of(fields, keyword))


def first_numbers(fields: Sequence[Dataset], keywords: Sequence[str], usual: list[float]) -> list[float]:
    """Return the numbers of the first field that has as many numbers as `usual`; else `usual`."""
    found = (numbers_of(fields, keyword) for keyword in keywords)
    return next((numbers for numbers in found if len(numbers) == len(usual)), usual)


def _numbers_in(text: str) -> list[float]:
    """Return the numbers in a text, which backslashes separate; an empty list if one is not a finite number."""
    try:
        numbers = [float(word) for word in text.split("\\")] if text else []
    except ValueError:
        return []
    return numbers if all(map(math.isfinite, numbers)) else []


def groups_of(dataset: Dataset, keyword: str) -> list[list[Dataset]]:
    """Return the functional groups of _GROUPS in each item of a sequence. keyword: the sequence."""
    items = dataset[keyword].value if keyword in dataset else []
    found = [[item[group].value[0] for group in _GROUPS if group in item and item[group].value] for item in items]
    return [[*groups, *(group[_DIRECTIONS].value[0] for group in groups if _DIRECTIONS in group)] for groups in found]


def vectors_of(dataset: Dataset, count: int) -> dict[Dimension, list[float]]:
    """Return the vectors of nuclear medicine that have a number for each of `count` frames."""
    vectors = {each: numbers_of([dataset], each.name) for each in VECTORS}
    return {each: numbers for each, numbers in vectors.items() if len(numbers) == count}


def frame_marks(fields: Sequence[Dataset], dimensions: Sequence[Dimension]) -> dict[Dimension, Mark]:
    """Return the mark (value) of a frame in each dimension for which the frame has a field.

    dimensions: the dimensions that the file declares, in the order of the indices of a frame.
    """
    indices = numbers_of(fields, "DimensionIndexValues")
    marks: dict[Dimension, Mark] = {each: ([k], "") for each, k in zip(dimensions, indices, strict=False)}
    for dimension in TOLD_APART:
        texts = [text_of(fields, keyword) for keyword in dimension.name.split(" and ")]
        if any(texts):
            numbers = [number for text in texts for number in _numbers_in(text)]
            marks.setdefault(dimension, (numbers, "" if numbers else "".join(texts)))
    return marks


def times_in(fields: Sequence[Dataset]) -> dict[str, float]:
    """Return the times of a frame, each under the keyword of its field, for the fields of CLOCKS that the frame has."""
    times = {}
    for keyword, (_, is_clock) in CLOCKS.items():
        text = text_of(fields, keyword)
        clock = _CLOCK.fullmatch(text) if is_clock else None
        times[keyword] = [60 * (60 * int(clock[1]) + int(clock[2])) + float(clock[3])] if clock else []
        times[keyword] += [] if is_clock else _numbers_in(text)
    return {keyword: found[0] for keyword, found in times.items() if found}


def value_unit_in(fields: Sequence[Dataset], unit: str, *, may_be_air: bool) -> str:
    """Return the unit of the rescaled values of a frame; an empty text if it has none.

    unit: the unit that the scale states, or an empty text. may_be_air: whether the scale has a value for air. With it,
    rescaled values of CT without a unit are in HU; without it, they were scaled for display.
    """
    given = [unit, *(text_of(fields, keyword).strip() for keyword in ("RescaleType", "Units", "DoseUnits"))]
    if may_be_air and not any(given) and text_of(fields, "Modality") == "CT" and text_of(fields, "RescaleIntercept"):
        given = ["HU"]
    return next((text for text in given if text.upper() not in _NO_UNITS), "")


def declared_dimensions(dataset: Dataset) -> list[Dimension]:
    """Return the dimensions that a file declares; each of its frames has an index for each of them."""
    from pydicom.datadict import keyword_for_tag

    items = dataset.get("DimensionIndexSequence") or []
    names = [keyword_for_tag(item.get("DimensionIndexPointer", 0)) for item in items]
    return [Dimension(name or f"dimension {k + 1}", "t" if name in _TIMES else "c") for k, name in enumerate(names)]
