"""Write DICOM slices by SimpleITK."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import SimpleITK as sitk  # noqa: N813

Array = npt.NDArray[np.generic]

# Of a tilted series.
ROW = np.array([0.0, 0.8, 0.6])
COLUMN = np.array([1.0, 0.0, 0.0])
NORMAL = np.cross(ROW, COLUMN)


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
    """Write one CT slice of `values` [y, x], pixels 0.5 wide and 0.25 high.

    intercept: SimpleITK subtracts it from the values that it stores.
    """
    image = sitk.GetImageFromArray(values.astype(np.int16))
    image.SetSpacing((0.5, 0.25))
    for key, text in {
        "0008|0008": "ORIGINAL\\PRIMARY\\AXIAL",
        "0008|0060": "CT",
        "0008|103e": name,
        "0020|000d": "1.2.3",
        "0020|000e": uid,
        "0020|0032": "\\".join(f"{value:.10g}" for value in position),
        "0020|0037": "\\".join(f"{value:.10g}" for value in axes),
        "0028|1052": str(intercept),
        "0028|1053": "1",
    }.items():
        image.SetMetaData(key, text)
    writer = sitk.ImageFileWriter()
    writer.KeepOriginalImageUIDOn()
    writer.SetFileName(str(path))
    writer.Execute(image)


def write_series(folder: Path, positions: Sequence[Array]) -> Array:
    """Write slices that hold their number at the first pixel; file names run backwards, so that they say nothing about
    the order."""
    planes = np.zeros((len(positions), 6, 5))
    planes[:, 0, 0] = np.arange(len(positions))
    planes[:, 1, 2] = 100
    for k, (plane, position) in enumerate(zip(planes, positions, strict=True)):
        write_slice(folder / f"{99 - k}.dcm", plane, position)
    return planes
