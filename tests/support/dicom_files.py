"""Write DICOM files by pydicom, and compress them by GDCM."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gdcm
import numpy as np
import numpy.typing as npt
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, ImplicitVRLittleEndian

Array = npt.NDArray[np.generic]

# The direction along the rows of the slices of a tilted series.
ROW = np.array([0.0, 0.8, 0.6])
# The direction along the columns of the slices of a tilted series.
COLUMN = np.array([1.0, 0.0, 0.0])
# The direction from slice to slice of a tilted series.
NORMAL = np.cross(ROW, COLUMN)


def _text(numbers: Sequence[float] | Array) -> list[str]:
    return [f"{number:.10g}" for number in numbers]


def image_fields(values: Array, *, uid: str = "1.2.3.4", **fields: Any) -> Dataset:
    """Return a dataset of a CT image. Its pixels are 0.5 mm wide and 0.25 mm high.

    values: the stored values, [y, x] or [frame, y, x]. fields: further fields of the dataset, by their keywords; None
    removes a field.
    """
    dataset = Dataset()
    dataset.file_meta = FileMetaDataset()
    dataset.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian
    dataset.file_meta.MediaStorageSOPClassUID = CTImageStorage
    dataset.file_meta.MediaStorageSOPInstanceUID = "1.2.3.4.5"
    is_signed = values.dtype.kind == "i"
    bits = 8 * values.dtype.itemsize
    named = {
        "ImageType": ["ORIGINAL", "PRIMARY", "AXIAL"], "SOPClassUID": CTImageStorage, "SOPInstanceUID": "1.2.3.4.5",
        "Modality": "CT", "StudyInstanceUID": "1.2.3", "SeriesInstanceUID": uid, "SamplesPerPixel": 1,
        "PhotometricInterpretation": "MONOCHROME2", "NumberOfFrames": str(len(values)) if values.ndim == 3 else None,
        "Rows": values.shape[-2], "Columns": values.shape[-1], "PixelSpacing": [".25", ".5"], "BitsAllocated": bits,
        "BitsStored": bits, "HighBit": bits - 1, "PixelRepresentation": int(is_signed), "PixelData": values.tobytes(),
    }  # fmt: skip
    for keyword, value in (named | fields).items():
        if value is not None:
            setattr(dataset, keyword, value)
    return dataset


def dicom_bytes(dataset: Dataset, syntax: str = ExplicitVRLittleEndian) -> bytes:
    """Return a DICOM file with a preamble.

    syntax: a transfer syntax that pydicom can write, or by which the dataset's pixels are compressed.
    """
    out = io.BytesIO()
    dataset.file_meta.TransferSyntaxUID = syntax
    dataset.save_as(out, enforce_file_format=True)
    return out.getvalue()


def save(path: Path, dataset: Dataset) -> None:
    """Write a dataset as a DICOM file with a preamble."""
    dataset.save_as(path, enforce_file_format=True)


def write_slice(
    path: Path,
    values: Array,
    position: Array | Sequence[float],
    *,
    axes: Sequence[float] = (*ROW, *COLUMN),
    intercept: int = -1000,
    uid: str = "1.2.3.4",
    name: str = "scan",
) -> None:
    """Write a CT slice of `values` [y, x], which are stored without the intercept that readers add again."""
    stored = (values - intercept).astype(np.int16)
    dataset = image_fields(stored, uid=uid, SeriesDescription=name, RescaleIntercept=str(intercept), RescaleSlope="1")
    dataset.ImagePositionPatient = _text(position)
    dataset.ImageOrientationPatient = _text(axes)
    save(path, dataset)


def write_series(folder: Path, positions: Sequence[Array]) -> Array:
    """Write a slice at each position, and return their values, [z, y, x].

    The first pixel of each slice is its number. File names run backwards, so that their order is of no help.
    """
    planes = np.zeros((len(positions), 6, 5))
    planes[:, 0, 0] = np.arange(len(positions))
    planes[:, 1, 2] = 100
    for k, (plane, position) in enumerate(zip(planes, positions, strict=True)):
        write_slice(folder / f"{99 - k}.dcm", plane, position)
    return planes


def functional_groups(values: Array, order: Sequence[int], *, spacing: float = 7.0) -> Dataset:
    """Return the dataset of an enhanced image, whose frames have functional groups.

    values: at least -1000, [frame, y, x]. order: the numbers of the frames, in the order in which they are stored.
    spacing: the distance between frames.
    """
    measures, plane, transform = Dataset(), Dataset(), Dataset()
    measures.PixelSpacing = ["0.25", "0.5"]
    plane.ImageOrientationPatient = ["1", "0", "0", "0", "1", "0"]
    transform.RescaleIntercept, transform.RescaleSlope = "-1000", "1"
    shared = Dataset()
    shared.PixelMeasuresSequence, shared.PlaneOrientationSequence = [measures], [plane]
    shared.PixelValueTransformationSequence = [transform]
    frames = []
    for k in order:
        position, frame = Dataset(), Dataset()
        position.ImagePositionPatient = ["1", "2", f"{3 + spacing * k:g}"]
        frame.PlanePositionSequence = [position]
        frames.append(frame)
    groups = {"SharedFunctionalGroupsSequence": [shared], "PerFrameFunctionalGroupsSequence": frames}
    stored = (values[list(order)].astype(np.int64) + 1000).astype(np.uint16)
    return image_fields(stored, PixelSpacing=None, BitsStored=12, HighBit=11, **groups)


def transcode(plain: Path, compressed: Path, syntax: int) -> None:
    """Compress the pixels of a file by GDCM, the package that reads them."""
    reader, change, writer = gdcm.ImageReader(), gdcm.ImageChangeTransferSyntax(), gdcm.ImageWriter()
    reader.SetFileName(str(plain))
    assert reader.Read()
    change.SetTransferSyntax(gdcm.TransferSyntax(syntax))
    change.SetInput(reader.GetImage())
    assert change.Change()
    writer.SetFile(reader.GetFile())
    writer.SetImage(change.GetOutput())
    writer.SetFileName(str(compressed))
    assert writer.Write()
