"""VTK images that break off, which VTK itself reads with other voxels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkIOLegacy import vtkStructuredPointsWriter
from vtkmodules.vtkIOXML import vtkXMLImageDataWriter

from renderer.errors import InputError
from tests.support.volume_files import ramp, read


def write(path: Path, *arrays: np.ndarray) -> None:
    """Write arrays [z, y, x] without compression or text, the first named `a`, the next `b`."""
    image = vtkImageData()
    image.SetDimensions(arrays[0].shape[::-1])
    for name, values in zip("ab", arrays, strict=False):
        array = numpy_to_vtk(values.ravel(), deep=True)
        array.SetName(name)
        image.GetPointData().AddArray(array)
    writer: Any = vtkXMLImageDataWriter() if path.suffix == ".vti" else vtkStructuredPointsWriter()
    if path.suffix == ".vti":
        writer.SetDataModeToAppended()
        writer.SetCompressorTypeToNone()
        writer.SetEncodeAppendedData(False)
    else:
        writer.SetFileTypeToBinary()
    writer.SetFileName(str(path))
    writer.SetInputData(image)
    writer.Write()


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("name", ["a.vti", "a.vtk"])
def test_images_that_break_off(tmp_path, name):
    values = ramp("int16", (6, 7, 8))
    write(tmp_path / name, values)
    np.testing.assert_array_equal(read(tmp_path / name).values, values)
    data = (tmp_path / name).read_bytes()
    for num_lost in (40, 200, 600):
        (tmp_path / name).write_bytes(data[:-num_lost])
        with pytest.raises(InputError, match="this VTK file is damaged"):
            read(tmp_path / name)


@pytest.mark.usefixtures("one_process")
def test_images_with_a_part_lost(tmp_path):
    values = ramp("int16", (6, 7, 8))
    write(tmp_path / "a.vti", values, values + 1)
    np.testing.assert_array_equal(read(tmp_path / "a.vti", component=1).values, values + 1)
    data = (tmp_path / "a.vti").read_bytes()
    begin = data.index(b"_", data.index(b"<AppendedData")) + 100
    (tmp_path / "a.vti").write_bytes(data[:begin] + data[begin + 50 :])
    with pytest.raises(InputError, match="this VTK file is damaged") as caught:
        read(tmp_path / "a.vti", component=1)
    assert caught.value.got == "1305 bytes of values, of 1344"


@pytest.mark.usefixtures("one_process")
def test_components_of_long_names_are_listed_in_a_line(tmp_path):
    array = numpy_to_vtk(np.zeros((8, 30)), deep=True)
    array.SetName("x" * 150)
    image = vtkImageData()
    image.SetDimensions(2, 2, 2)
    image.GetPointData().AddArray(array)
    writer = vtkXMLImageDataWriter()
    writer.SetFileName(str(tmp_path / "a.vti"))
    writer.SetInputData(image)
    writer.Write()
    with pytest.raises(InputError, match="the volume has 30 components") as caught:
        read(tmp_path / "a.vti")
    assert all(len(line) <= 400 for line in str(caught.value).split("\n"))
