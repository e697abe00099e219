"""Part a mosaic of Siemens, which has the slices of a volume side by side in one image, into its slices."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.dicom_fields import Dataset, numbers_of, text_of, value_of
from renderer.readers.dicom_frame import Frame

_IMAGE_TYPE, _MATRIX, _THICKNESS, _BETWEEN_SLICES = 0x00080008, 0x00181310, 0x00180050, 0x00180088
_NUM_SLICES, _HEADER = 0x0019100A, 0x00291010

_GUESSED = "a mosaic that does not say how many slices it has; all of its {} tiles are taken for slices"
_THICK = "a mosaic without a distance of slices; their thickness is taken"


def slices_of(dataset: Dataset, frame: Frame) -> list[Frame]:
    """Return the slices of a frame: itself, or those of a mosaic; raises InputError for a mosaic that does not fit.

    The position of a mosaic is that of a single image as large as all of it around the same centre. Without the normal
    in Siemens' own header, slices follow the normal of the image.
    """
    if "MOSAIC" not in (text_of(dataset, _IMAGE_TYPE) or ""):
        return [frame]
    header = _siemens_header(dataset)
    num, per_side = _counts(dataset, header)
    size = frame.size[0] // per_side, frame.size[1] // per_side
    if not 1 <= num <= per_side**2 or frame.size != (per_side * size[0], per_side * size[1]):
        raise InputError(
            "this mosaic cannot be parted into its slices",
            where=str(frame.file),
            got=f"{num} slices in {frame.size[0]} x {frame.size[1]} pixels",
            expected="NumberOfImagesInMosaic, or AcquisitionMatrix, in squares of equal tiles",
            hint="convert it by dcm2niix first",
        )
    between, thick = numbers_of([dataset], _BETWEEN_SLICES), numbers_of([dataset], _THICKNESS)
    distance = abs((between or thick or [0.0])[0]) or frame.thickness
    notes = (None if _stated(dataset, header) else _GUESSED.format(num), None if between else _THICK)
    normal = _vector(header, "SliceNormalVector")
    step = frame.normal * distance * (-1 if len(normal) == 3 and frame.normal @ np.array(normal) < 0 else 1)
    corner = frame.position
    for axis, whole, part in zip((frame.across, frame.down), frame.size, size, strict=True):
        corner = corner + axis * (whole - part) / 2
    return [
        replace(
            frame,
            size=size,
            corner=(k % per_side * size[0], k // per_side * size[1]),
            position=corner + k * step,
            thickness=distance,
            notes=notes,
        )
        for k in range(num)
    ]


def _stated(dataset: Dataset, header: dict[str, Any]) -> int:
    """Return the number of slices that a mosaic states; 0 if it states none."""
    field = dataset.get_item(_NUM_SLICES) if _NUM_SLICES in dataset else None
    raw = None if field is None else field.value
    own = int.from_bytes(raw[:2], "little") if isinstance(raw, bytes) else int(raw or 0)
    return own or int((_vector(header, "NumberOfImagesInMosaic") or [0])[0])


def _counts(dataset: Dataset, header: dict[str, Any]) -> tuple[int, int]:
    """Return the number of slices of a mosaic, and of its tiles along a side."""
    stated = _stated(dataset, header)
    if stated > 0:
        return stated, math.isqrt(stated - 1) + 1
    matrix = [int(word) for word in value_of([dataset], _MATRIX).strip("[]").split(",") if word.strip().isdigit()]
    per_side = int(dataset.Rows) // max(matrix, default=int(dataset.Rows) + 1)
    return per_side**2, max(per_side, 1)


def _siemens_header(dataset: Dataset) -> dict[str, Any]:
    """Return the fields of Siemens' own header; none if there is none, or a damaged one."""
    raw = dataset.get_item(_HEADER).value if _HEADER in dataset else None
    if not isinstance(raw, bytes):
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it is experimental
        from nibabel.nicom import csareader
    try:
        tags: dict[str, Any] = csareader.read(raw)["tags"]  # type: ignore[no-untyped-call]
    except Exception:  # of its parser, for damaged bytes
        return {}
    return tags


def _vector(header: dict[str, Any], name: str) -> list[float]:
    try:
        return [float(item) for item in header[name]["items"]]
    except (KeyError, TypeError, ValueError):
        return []
