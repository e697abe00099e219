"""Split a Siemens mosaic, an image with the slices of a volume side by side, into its slices."""

from __future__ import annotations

import math
import warnings
from contextlib import suppress
from dataclasses import replace
from typing import Any

from renderer.errors import InputError
from renderer.readers.dicom_fields import IMAGE_TYPE, Dataset, numbers_of, open_dicom
from renderer.readers.dicom_frames import Frame
from renderer.volume import Float64

# The note on a mosaic whose number of slices is missing.
_GUESSED = "a mosaic that does not say how many slices it has; all of its {} tiles are taken for slices"
# The note on a mosaic whose distance between slices is missing.
_THICK = "a mosaic without a distance of slices; their thickness is taken"


def slices_of(frame: Frame) -> list[Frame]:
    """Return the slices of a mosaic, or the frame itself if it is not a mosaic.

    The position in the file is the corner of an imaginary image, as large as the mosaic, around the centre of the first
    slice. Slices follow one another along the normal in Siemens' own header or, without it, the normal of the image.
    Raises InputError if the pixels cannot be divided into the slices.
    """
    if "MOSAIC" not in str(frame.marks.get(IMAGE_TYPE)):
        return [frame]
    dataset = open_dicom(frame.file)[0]
    stated, normal = _siemens_header(dataset)
    tile = int(max(numbers_of([dataset], "AcquisitionMatrix"), default=0.0)) or frame.size[1]
    per_side = math.isqrt(stated - 1) + 1 if stated > 0 else max(frame.size[1] // tile, 1)
    num, size = stated or per_side**2, (frame.size[0] // per_side, frame.size[1] // per_side)
    if frame.size != (per_side * size[0], per_side * size[1]) or not 1 <= num <= per_side**2:
        raise InputError(
            "this mosaic cannot be parted into its slices",
            where=str(frame.file),
            got=f"{num} slices in {frame.size[0]} x {frame.size[1]} pixels",
            expected="NumberOfImagesInMosaic, or AcquisitionMatrix, in squares of equal tiles",
            hint="convert it by dcm2niix first",
        )
    between, thick = numbers_of([dataset], "SpacingBetweenSlices"), numbers_of([dataset], "SliceThickness")
    distance = abs((between or thick or [0.0])[0]) or frame.thickness
    notes = (None if stated else _GUESSED.format(num), None if between else _THICK)
    step = frame.normal * distance * (-1 if normal is not None and frame.normal @ normal < 0 else 1)
    middle = frame.across * (frame.size[0] - size[0]) / 2 + frame.down * (frame.size[1] - size[1]) / 2
    mosaic = replace(frame, size=size, thickness=distance, notes=(*frame.notes, *notes), has_place=True)
    corners = [(k % per_side * size[0], k // per_side * size[1]) for k in range(num)]
    return [replace(mosaic, corner=at, position=frame.position + middle + k * step) for k, at in enumerate(corners)]


def _siemens_header(dataset: Dataset) -> tuple[int, Float64 | None]:
    """Return the number of slices of a mosaic and their normal from Siemens' own fields.

    The number is 0, and the normal is None, if the field is missing or damaged.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # nibabel warns that csareader is experimental
        from nibabel.nicom import csareader
    reader: Any = csareader
    number, normal = 0, None
    with suppress(Exception):  # parsers raise any exception for missing fields and damaged bytes
        number = int(dataset.private_block(0x0019, "SIEMENS MR HEADER")[0x0A].value)
    with suppress(Exception):
        header = reader.get_csa_header(dataset)
        normal = reader.get_slice_normal(header)
        number = number or int(reader.get_n_mosaic(header))
    return number, normal
