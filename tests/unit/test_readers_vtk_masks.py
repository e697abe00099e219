"""Masks of VTK: points and cells that are hidden have no data, whatever the type of the values."""

from __future__ import annotations

import numpy as np
import pytest
from stated_vtk import write_vtk
from volume_files import ramp, read, refused, written
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkSphere
from vtkmodules.vtkFiltersCore import vtkResampleToImage
from vtkmodules.vtkFiltersExtraction import vtkExtractGeometry
from vtkmodules.vtkIOXML import vtkXMLImageDataWriter

pytestmark = pytest.mark.usefixtures("one_process")

SHAPE = (3, 4, 5)
# Bits of vtkDataSetAttributes.
DUPLICATE, HIDDEN_POINT, HIDDEN_CELL = 1, 2, 32


def test_points_outside_of_a_grid_that_vtk_resamples(tmp_path):
    """Those that vtkResampleToImage could not sample are where VTK itself says that they are invalid."""
    source = vtkImageData()
    source.SetDimensions(9, 9, 9)
    source.AllocateScalars(10, 1)  # float
    source.GetPointData().GetScalars().Fill(7.0)
    sphere = vtkSphere()
    sphere.SetCenter(4, 4, 4)
    sphere.SetRadius(3.5)
    part = vtkExtractGeometry()
    part.SetImplicitFunction(sphere)
    part.SetInputData(source)
    resample = vtkResampleToImage()
    resample.SetInputConnection(part.GetOutputPort())
    resample.SetSamplingDimensions(9, 9, 9)
    resample.UseInputBoundsOff()
    resample.SetSamplingBounds(0, 8, 0, 8, 0, 8)
    writer = vtkXMLImageDataWriter()
    writer.SetFileName(str(tmp_path / "a.vti"))
    writer.SetInputConnection(resample.GetOutputPort())
    assert writer.Write() == 1
    volume = read(tmp_path / "a.vti")
    assert volume.value_range() == (7.0, 7.0)
    image = resample.GetOutput()
    hidden = [not image.IsPointVisible(k) for k in range(9**3)]
    assert 0 < sum(hidden) < 9**3
    np.testing.assert_array_equal(np.isnan(volume.values).ravel(), hidden)


@pytest.mark.parametrize(("dtype", "expected"), [("uint8", "float16"), ("int32", "float32"), ("int64", "float32")])
def test_integers_become_floats_that_hold_them(tmp_path, dtype, expected):
    values, mask = np.arange(60).reshape(SHAPE).astype(dtype), np.zeros(SHAPE, np.uint8)
    mask[1, 2, 3] = HIDDEN_POINT | DUPLICATE
    volume = read(write_vtk(tmp_path / "a.vti", {"a": values, "vtkGhostType": mask}, dimensions=(5, 4, 3)))
    np.testing.assert_array_equal(volume.values, np.where(mask, np.nan, values))
    assert volume.values.dtype == expected
    assert volume.note is not None and "vtkGhostType hides" in volume.note and volume.channels == ()


def test_duplicates_are_data(tmp_path):
    values = ramp("int16")
    mask = np.full(SHAPE, DUPLICATE, np.uint8)
    volume = read(write_vtk(tmp_path / "a.vti", {"a": values, "vtkGhostType": mask}, dimensions=(5, 4, 3)))
    np.testing.assert_array_equal(volume.values, values)
    assert volume.values.dtype == np.int16


def visible(image, num, method):
    return [not getattr(image, method)(k) for k in range(num)]


def test_hidden_cells_and_their_points(tmp_path):
    """A cell is hidden as VTK has it: by its own bit, or by that of a corner; a point, where all of its cells are."""
    images = []
    cells, points = np.zeros((2, 3, 4), np.uint8), np.zeros(SHAPE, np.uint8)
    cells[0, :2, :2], points[2, 3, 4] = HIDDEN_CELL, HIDDEN_POINT
    of_cells = {"c": ramp("float32", (2, 3, 4)), "vtkGhostType": cells}
    path = write_vtk(tmp_path / "a.vti", {"vtkGhostType": points}, of_cells, (5, 4, 3), images.append)
    expected = visible(images[0], cells.size, "IsCellVisible")
    np.testing.assert_array_equal(np.isnan(read(path).values).ravel(), expected)
    assert sum(expected) == 5
    path = write_vtk(tmp_path / "b.vti", {"p": ramp("float32")}, {"vtkGhostType": cells}, (5, 4, 3))
    hidden = np.zeros(SHAPE, bool)
    hidden[0, :2, :2] = True  # the points on the outside of the four cells; the others have a visible cell
    np.testing.assert_array_equal(np.isnan(read(path).values), hidden)


XML = """<VTKFile type="ImageData"><ImageData WholeExtent="0 2 0 1 0 1" Origin="0 0 0" Spacing="{}">
{}</ImageData></VTKFile>"""
PIECE = """<Piece Extent="{}"><{}><DataArray type="Float32" Name="a" format="ascii">{}</DataArray></{}></Piece>"""


@pytest.mark.parametrize(
    ("pieces", "got"),
    [
        ([("0 2 0 1 0 1", 12)], None),
        ([("0 1 0 1 0 1", 8), ("1 2 0 1 0 1", 8)], None),
        ([("0 1 0 1 0 1", 8)], "4 points in none of its pieces"),
        ([("7 9 0 1 0 1", 12)], "12 points in none of its pieces"),
        ([], "no values"),
    ],
)
def test_points_in_no_piece_are_not_what_is_in_memory(tmp_path, pieces, got):
    """VTK itself leaves them as they are in memory."""
    inside = "".join(PIECE.format(extent, "PointData", "1 " * count, "PointData") for extent, count in pieces)
    path = written(tmp_path / "a.vti", XML.format("1 1 1", inside).encode())
    if got is None:
        np.testing.assert_array_equal(read(path).values, np.ones((2, 2, 3)))
    else:
        assert refused(path, match="this VTK file is damaged").got == got


def test_cells_between_pieces(tmp_path):
    pieces = [("0 1 0 1 0 1", 1), ("2 2 0 1 0 1", 1)]
    inside = "".join(PIECE.format(extent, "CellData", "1 " * count, "CellData") for extent, count in pieces)
    path = written(tmp_path / "a.vti", XML.format("1 1 1", inside).encode())
    assert refused(path).got == "1 cells in none of its pieces"


@pytest.mark.parametrize("spacing", ["nan 1 1", "1 1", "1 1 1 1", "1 1 inf", "a b c"])
def test_places_that_are_no_numbers(tmp_path, spacing):
    """VTK itself takes 1 in their place."""
    inside = PIECE.format("0 2 0 1 0 1", "PointData", "1 " * 12, "PointData")
    path = written(tmp_path / "a.vti", XML.format(spacing, inside).encode())
    assert refused(path).got == "Spacing that is not 3 numbers"


def test_the_active_scalars_come_first_and_cells_are_named(tmp_path):
    values = ramp("float32")

    def activate(image):
        image.GetPointData().SetActiveScalars("p")

    arrays = {"T": values, "p": values + 1}
    path = write_vtk(tmp_path / "a.vti", arrays, {"c": np.zeros((2, 3, 4))}, (5, 4, 3), activate)
    volume = read(path)
    np.testing.assert_array_equal(volume.values, values + 1)
    np.testing.assert_array_equal(read(path, component=1).values, values)
    assert volume.note is not None and "arrays of cells beside those of points are left out: c" in volume.note
