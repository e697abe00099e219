"""Part a mosaic of Siemens, which has the slices of a volume side by side in one image, into its slices."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.dicom_fields import IMAGE_TYPE, Dataset, numbers_in, numbers_of, open_dicom, value_of
from renderer.readers.dicom_frames import Frame

_MATRIX, _THICKNESS, _BETWEEN_SLICES = 0x00181310, 0x00180050, 0x00180088
_NUM_SLICES, _HEADER = 0x0019100A, 0x00291010

_GUESSED = "a mosaic that does not say how many slices it has; all of its {} tiles are taken for slices"
_THICK = "a mosaic without a distance of slices; their thickness is taken"


def slices_of(frame: Frame) -> list[Frame]:
    """Return the slices of a frame: itself, or those of a mosaic; raises InputError for a mosaic that does not fit.

    The position of a mosaic is that of a single image as large as all of it around the same centre. Without the normal
    in Siemens' own header, slices follow the normal of the image.
    """
    if "MOSAIC" not in str(frame.marks.get(IMAGE_TYPE)):
        return [frame]
    dataset = open_dicom(frame.file)[0]
    header = _siemens_header(dataset)
    stated = _stated(dataset, header)
    per_side = math.isqrt(stated - 1) + 1 if stated > 0 else _tiles_by_matrix(dataset)
    num, size = stated or per_side**2, (frame.size[0] // per_side, frame.size[1] // per_side)
    if frame.size != (per_side * size[0], per_side * size[1]) or not 1 <= num <= per_side**2:
        raise InputError(
            "this mosaic cannot be parted into its slices",
            where=str(frame.file),
            got=f"{num} slices in {frame.size[0]} x {frame.size[1]} pixels",
            expected="NumberOfImagesInMosaic, or AcquisitionMatrix, in squares of equal tiles",
            hint="convert it by dcm2niix first",
        )
    between, thick = numbers_of([dataset], _BETWEEN_SLICES), numbers_of([dataset], _THICKNESS)
    distance = abs((between or thick or [0.0])[0]) or frame.thickness
    notes = (None if stated else _GUESSED.format(num), None if between else _THICK)
    normal = _vector(header, "SliceNormalVector")
    step = frame.normal * distance * (-1 if len(normal) == 3 and frame.normal @ np.array(normal) < 0 else 1)
    middle = frame.across * (frame.size[0] - size[0]) / 2 + frame.down * (frame.size[1] - size[1]) / 2
    mosaic = replace(frame, size=size, thickness=distance, notes=notes)
    corners = [(k % per_side * size[0], k // per_side * size[1]) for k in range(num)]
    return [replace(mosaic, corner=at, position=frame.position + middle + k * step) for k, at in enumerate(corners)]


def _stated(dataset: Dataset, header: dict[str, Any]) -> int:
    """Return the number of slices that a mosaic states; 0 if it states none."""
    raw = dataset.get_item(_NUM_SLICES).value if _NUM_SLICES in dataset else None
    own = int.from_bytes(raw[:2], "little") if isinstance(raw, bytes) else int(raw or 0)
    return own or int((_vector(header, "NumberOfImagesInMosaic") or [0])[0])


def _tiles_by_matrix(dataset: Dataset) -> int:
    """Return the number of tiles along a side of a mosaic, by the larger size of what was acquired; else 1."""
    matrix = numbers_in(value_of([dataset], _MATRIX)) or [0.0]
    return max(int(dataset.Rows // max(*matrix, 1.0)), 1) if max(matrix) > 0 else 1


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
