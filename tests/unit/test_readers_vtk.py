"""VTK images: values, places and components; files that break off, which VTK itself reads with other voxels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkIOLegacy import vtkStructuredPointsWriter
from vtkmodules.vtkIOXML import vtkXMLImageDataWriter

from tests.support.volume_files import ramp, read, refused, written

VALUES = ramp("int16")
LARGER = ramp("int16", (6, 7, 8))


def write(
    path: Path, arrays: dict[str, np.ndarray], *, is_text: bool = False, is_plain: bool = False, is_cells: bool = False
) -> None:
    """Write arrays [z, y, x] or [z, y, x, component]. is_plain: without compression, and not encoded as text."""
    image = vtkImageData()
    image.SetDimensions(*(n + is_cells for n in next(iter(arrays.values())).shape[2::-1]))
    image.SetSpacing(0.5, 2.0, 3.0)
    image.SetOrigin(10.0, 20.0, 30.0)
    for name, values in arrays.items():
        array = numpy_to_vtk(values.reshape(-1, *values.shape[3:]), deep=True)
        array.SetName(name)
        (image.GetCellData() if is_cells else image.GetPointData()).AddArray(array)
    writer: Any = vtkXMLImageDataWriter() if path.suffix == ".vti" else vtkStructuredPointsWriter()
    if path.suffix == ".vti":
        writer.SetDataModeToAscii() if is_text else writer.SetDataModeToAppended()
        writer.SetEncodeAppendedData(not is_plain)
        if is_plain:
            writer.SetCompressorTypeToNone()
    else:
        writer.SetFileTypeToASCII() if is_text else writer.SetFileTypeToBinary()
    writer.SetFileName(str(path))
    writer.SetInputData(image)
    assert writer.Write() == 1


@pytest.mark.parametrize("is_text", [False, True])
@pytest.mark.parametrize("name", ["a.vti", "a.vtk"])
def test_vtk_images(tmp_path, name, is_text):
    write(tmp_path / name, {"density": VALUES}, is_text=is_text)
    volume = read(tmp_path / name)
    np.testing.assert_array_equal(volume.values, VALUES)
    np.testing.assert_array_equal(volume.spacing, [0.5, 2, 3])
    np.testing.assert_array_equal(volume.world_from_index[:3, 3], [10, 20, 30])
    data = (tmp_path / name).read_bytes()
    refused(written(tmp_path / name, data[: len(data) // 2]), match=r"damaged|ended the process")


@pytest.mark.usefixtures("one_process")
def test_arrays_of_vtk_are_components(tmp_path):
    velocity = np.stack([VALUES.astype(np.float32) + k for k in range(3)], axis=-1)
    write(tmp_path / "a.vti", {"p": VALUES, "v": velocity})
    np.testing.assert_array_equal(read(tmp_path / "a.vti", component=3).values, VALUES.astype(np.float32) + 2)
    first = read(tmp_path / "a.vti")
    np.testing.assert_array_equal(first.values, VALUES)
    named = "4 components (p, v[0], v[1], v[2])"
    assert first.note == f"{named}; the first is drawn; `component: k` chooses another"


@pytest.mark.usefixtures("one_process")
def test_cells_lie_between_points(tmp_path):
    write(tmp_path / "a.vti", {"p": VALUES}, is_cells=True)
    volume = read(tmp_path / "a.vti")
    np.testing.assert_array_equal(volume.values, VALUES)
    np.testing.assert_array_equal(volume.world_from_index[:3, 3], [10.25, 21, 31.5])


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("name", ["a.vti", "a.vtk"])
def test_images_that_break_off(tmp_path, name):
    write(tmp_path / name, {"a": LARGER}, is_plain=True)
    np.testing.assert_array_equal(read(tmp_path / name).values, LARGER)
    data = (tmp_path / name).read_bytes()
    for num_lost in (40, 200, 600):
        refused(written(tmp_path / name, data[:-num_lost]), match="this VTK file is damaged")


@pytest.mark.usefixtures("one_process")
def test_images_with_a_part_lost(tmp_path):
    write(tmp_path / "a.vti", {"a": LARGER, "b": LARGER + 1}, is_plain=True)
    np.testing.assert_array_equal(read(tmp_path / "a.vti", component=1).values, LARGER + 1)
    data = (tmp_path / "a.vti").read_bytes()
    begin = data.index(b"_", data.index(b"<AppendedData")) + 100
    (tmp_path / "a.vti").write_bytes(data[:begin] + data[begin + 50 :])
    caught = refused(tmp_path / "a.vti", component=1, match="this VTK file is damaged")
    assert caught.got == "1305 bytes of values, of 1344"


@pytest.mark.usefixtures("one_process")
def test_components_of_long_names_are_listed_in_a_line(tmp_path):
    write(tmp_path / "a.vti", {"x" * 150: np.zeros((2, 2, 2, 30))})
    note = read(tmp_path / "a.vti").note
    assert note is not None and note.startswith("30 components (xxx") and len(note) <= 400
