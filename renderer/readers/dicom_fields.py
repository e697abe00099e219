"""Read the fields of a DICOM file: their text, numbers, and those that tell frames at one place apart."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from renderer.errors import InputError

# A pydicom.Dataset.
Dataset = Any

POSITION, ORIENTATION = 0x00200032, 0x00200037
SHARED_GROUPS, FRAME_GROUPS = 0x52009229, 0x52009230
# The functional groups that are needed: Pixel Measures, Plane Position and Orientation, Pixel Value Transformation; and
# of what tells frames apart: Frame Content, MR Echo, MR Diffusion with its direction, Cardiac Synchronization, Segment
# Identification, Temporal Position, MR Image Frame Type.
_GROUPS = (
    *(0x00289110, 0x00209113, 0x00209116, 0x00289145),
    *(0x00209111, 0x00189114, 0x00189117, 0x00189118, 0x0062000A, 0x00209310, 0x00189226),
)
_DIRECTIONS = 0x00189076

_DIMENSIONS, _DIMENSION_VALUES, _POINTER = 0x00209222, 0x00209157, 0x00209165


class Dimension(NamedTuple):
    """What differs between frames at one place.

    axis: `t` for times and the like, `c` for others. name: keywords of its fields.
    is_order: it says which frame came first, and perhaps nothing else.
    """

    axis: str
    name: str
    is_order: bool = False


# What is there of a dimension in each frame: numbers, or text that is none. Marks are sorted.
Mark = tuple[list[float], str]

# Fields that tell frames at one place apart, in the order in which they are tried. Each has its axis, and fields that
# count together.
_TOLD_APART = (
    *(("t", 0x00200100), ("t", 0x00209128)),  # temporal positions
    *(("c", 0x00180086), ("c", 0x00189082), ("c", 0x00180081)),  # echoes
    ("c", 0x00189087, 0x00189089),  # diffusion: b-value and direction
    ("c", 0x00180082),  # inversion time
    *(("t", 0x00209241), ("t", 0x00209153), ("t", 0x0020930D)),  # phases of the heart, time offsets
    *(("t", 0x00181060), ("t", 0x00541300)),  # trigger and reference time
    *(("c", 0x00089208), ("c", 0x00089007), ("c", 0x00080008)),  # magnitude and phase, types
)
# Acquisition number, date and time, content time, instance number: of single slices, too.
_ORDERS = (0x00209156, 0x00200012, 0x00189074, 0x0008002A, 0x00080032, 0x00080033, 0x00200013)
# Vectors of nuclear medicine have a number for each frame: energy window, detector, phase, rotation, R-R interval, time
# slot, angular view, time slice.
_VECTORS = {
    **{0x00540010: "c", 0x00540020: "c", 0x00540030: "t", 0x00540050: "c"},
    **{0x00540060: "t", 0x00540070: "t", 0x00540090: "c", 0x00540100: "t"},
}
_TIMES = {tags[0] for axis, *tags in _TOLD_APART if axis == "t"} | {*_ORDERS}
IMAGE_TYPE = Dimension("c", "ImageType")
# Two fields part frames into volumes of their own: stacks, which may lie anywhere, and segments, which leave out empty
# slices.
STACK, SEGMENT = Dimension("c", "StackID"), Dimension("c", "ReferencedSegmentNumber")
_PARTS = {STACK: 0x00209056, SEGMENT: 0x0062000B}


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
        raise unreadable_slice(path, "a field of it is damaged: copy it again, or save it again") from error


def unreadable_slice(path: Path, hint: str = "the file is truncated or damaged", got: str | None = None) -> InputError:
    """Return the error for a file that cannot be read."""
    return InputError("this DICOM slice cannot be read", where=str(path), got=got, hint=hint)


def kind_without_pixels(dataset: Dataset) -> str | None:
    """Return the name of a kind of DICOM that never has pixels, such as `RT Plan`; None for any other."""
    from pydicom.uid import UID

    uid = UID(text_of(dataset, 0x00080016) or text_of(dataset.get("file_meta") or {}, 0x00020002) or "")
    name, is_known = uid.name.removesuffix(" Storage"), uid.type == "SOP Class"
    may_have_pixels = "Image" in name or name in ("Segmentation", "RT Dose", "Parametric Map")
    return name if is_known and not may_have_pixels and "Rows" not in dataset else None


def no_volume_error(path: Path, kind: str) -> InputError:
    """Return the error for a file of a kind that never has pixels."""
    hint = "name the images that it belongs to"
    if "Directory" in kind:
        hint = "an index of other files: name the folder that holds them"
    elif "Structure Set" in kind or "Surface" in kind:
        hint = "contours, not voxels: save them as a mask first, for example in 3D Slicer"
    return InputError(
        "this DICOM file holds no volume",
        where=str(path),
        got=f"{kind}, a kind of file without pixels",
        expected="an image, a dose or a segmentation",
        hint=hint,
    )


def text_of(fields: Dataset, tag: int) -> str | None:
    """Return the text of a field as it is in the file; None if it is missing."""
    if tag not in fields:
        return None
    raw = fields.get_item(tag).value
    text = raw.decode("latin-1") if isinstance(raw, bytes) else str(raw)
    return text.strip(" \0")


def numbers_of(fields: Sequence[Dataset], tag: int) -> list[float]:
    """Return the numbers of a field of text, in the first of these datasets that has it; an empty list if they are
    none."""
    return numbers_in(next((text for each in fields if (text := text_of(each, tag)) is not None), ""))


def numbers_in(text: str) -> list[float]:
    """Return the numbers that a text lists; an empty list if they are none, or not finite."""
    try:
        numbers = [float(word) for word in text.strip("[]").replace(",", "\\").split("\\")] if text else []
    except ValueError:
        return []
    return numbers if all(map(math.isfinite, numbers)) else []


def value_of(fields: Sequence[Dataset], tag: int) -> str:
    """Return the values of a field of any type as text, in the first of these datasets that has it; else nothing."""
    found = next((each for each in fields if tag in each), None)
    try:
        value = "" if found is None else found[tag].value
    except Exception:  # of its parser: a damaged field tells nothing
        return ""
    return "" if value is None else str(value)


def groups_of(dataset: Dataset, tag: int) -> list[list[Dataset]]:
    """Return for each item of a sequence of functional groups the datasets in the groups that are needed."""
    items = dataset[tag].value if tag in dataset else []
    found = [[item[group].value[0] for group in _GROUPS if group in item and item[group].value] for item in items]
    return [[*groups, *(group[_DIRECTIONS].value[0] for group in groups if _DIRECTIONS in group)] for groups in found]


def vectors_of(dataset: Dataset, count: int) -> dict[int, dict[Dimension, Mark]]:
    """Return for each of `count` frames what vectors for all of them say; nothing if there are none."""
    vectors = {tag: numbers_in(value_of([dataset], tag)) for tag in _VECTORS if tag in dataset}
    known = {Dimension(_VECTORS[tag], _name(tag)): own for tag, own in vectors.items() if len(own) == count}
    return {k: {dimension: ([own[k]], "") for dimension, own in known.items()} for k in range(count) if known}


def frame_marks(fields: Sequence[Dataset], dimensions: Sequence[Dimension]) -> dict[Dimension, Mark]:
    """Return what the fields say of one frame. dimensions: as `declared_dimensions` returns them."""
    indices = numbers_in(value_of(fields, _DIMENSION_VALUES)) if dimensions else []
    marks = {each: ([index], "") for each, index in zip(dimensions, indices, strict=False)}
    told = {part: _mark(value_of(fields, tag)) for part, tag in _PARTS.items()}
    for axis, *tags in _TOLD_APART:
        texts = [value_of(fields, tag) for tag in tags]
        numbers = [number for text in texts for number in numbers_in(text)]
        told[Dimension(axis, " and ".join(map(_name, tags)))] = numbers, "" if numbers else "".join(texts)
    told |= {Dimension("t", _name(tag), is_order=True): _mark(value_of(fields, tag)) for tag in _ORDERS}
    return marks | {each: mark for each, mark in told.items() if mark != ([], "") and each not in marks}


def declared_dimensions(dataset: Dataset) -> list[Dimension]:
    """Return the dimensions that a file names, whose indices each of its frames has."""
    items = dataset[_DIMENSIONS].value if _DIMENSIONS in dataset else []
    tags = [int(item[_POINTER].value) if _POINTER in item else 0 for item in items]
    return [Dimension("t" if tag in _TIMES else "c", _name(tag) or f"dimension {k + 1}") for k, tag in enumerate(tags)]


def _mark(text: str) -> Mark:
    numbers = numbers_in(text)
    return numbers, "" if numbers else text


def _name(tag: int) -> str:
    from pydicom.datadict import keyword_for_tag

    return keyword_for_tag(tag)
