"""VTK images: values, places and components; files that break off, which VTK itself reads with other voxels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from volume_files import ramp, read, refused, written
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkRectilinearGrid
from vtkmodules.vtkIOLegacy import vtkRectilinearGridWriter, vtkStructuredPointsWriter
from vtkmodules.vtkIOXML import vtkXMLImageDataWriter, vtkXMLRectilinearGridWriter

from renderer.readers import header_and_voxel_files

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


@pytest.mark.parametrize(("name", "is_text"), [("a.vti", True), ("a.vtk", False), ("a.vtk", True)])
@pytest.mark.usefixtures("one_process")
def test_vtk_images(tmp_path, name, is_text):
    require_vtk_image(tmp_path, name, is_text=is_text)


def test_a_vtk_image_in_the_child_process(tmp_path):
    require_vtk_image(tmp_path, "a.vti", is_text=False)


def require_vtk_image(tmp_path, name, *, is_text):
    """Read a file of VTK, and half of it, which is refused."""
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


def write_rectilinear(path: Path, x: list[float], *, is_cells: bool = False) -> None:
    grid = vtkRectilinearGrid()
    places = [x, [1.0, 3.0, 5.0, 7.0], [0.5, 1.0, 1.5]]
    grid.SetDimensions(*map(len, places))
    for axis, numbers in zip("XYZ", places, strict=True):
        getattr(grid, f"Set{axis}Coordinates")(numpy_to_vtk(np.array(numbers), deep=True))
    array = numpy_to_vtk(VALUES[: 3 - is_cells, : 4 - is_cells, : len(x) - is_cells].ravel(), deep=True)
    array.SetName("a")
    (grid.GetCellData() if is_cells else grid.GetPointData()).AddArray(array)
    writer: Any = vtkXMLRectilinearGridWriter() if path.suffix == ".vtr" else vtkRectilinearGridWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(grid)
    assert writer.Write() == 1


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("name", ["a.vtr", "a.vtk"])
def test_rectilinear_grids_that_are_even(tmp_path, name):
    write_rectilinear(tmp_path / name, [-3.0, -2.75, -2.5, -2.25, -2.0])
    volume = read(tmp_path / name)
    np.testing.assert_array_equal(volume.values, VALUES)
    np.testing.assert_allclose(volume.spacing, [0.25, 2, 0.5])
    np.testing.assert_allclose(volume.world_from_index[:3, 3], [-3, 1, 0.5])
    write_rectilinear(tmp_path / name, [-3.0, -2.75, -2.5, -2.25, -2.0], is_cells=True)
    volume = read(tmp_path / name)
    np.testing.assert_array_equal(volume.values, VALUES[:2, :3, :4])
    np.testing.assert_allclose(volume.world_from_index[:3, 3], [-2.875, 2, 0.75])
    write_rectilinear(tmp_path / name, [-3.0, -2.75, -2.0, -1.0, 2.0])
    error = refused(tmp_path / name, match="the coordinates of this grid are not even")
    assert error.got == "those along x" and "Resample To Image" in str(error.hint)


def write_pieces(folder: Path, *, is_cells: bool = False, in_whole: bool = False) -> Path:
    """Write an image of two pieces: its points are shared, its cells are not.

    in_whole: the pieces give the extent of the whole image, and their own as that of a part.
    """
    whole = (2, 6 + is_cells, 1, 4 + is_cells, 0, 2 + is_cells)
    extents = ((2, 4, *whole[2:]), (4, *whole[1:]))
    lines = []
    for k, extent in enumerate(extents):
        image = vtkImageData()
        image.SetExtent(extent)
        image.SetSpacing(0.5, 2.0, 3.0)
        image.SetOrigin(10.0, 20.0, 30.0)
        array = numpy_to_vtk(VALUES[:, :, extent[0] - 2 : extent[1] - 1 - is_cells].ravel(), deep=True)
        array.SetName("a")
        (image.GetCellData() if is_cells else image.GetPointData()).AddArray(array)
        writer = vtkXMLImageDataWriter()
        writer.SetCompressorTypeToNone()
        writer.SetEncodeAppendedData(False)
        writer.SetFileName(str(folder / f"p&{k}.vti"))
        writer.SetInputData(image)
        assert writer.Write() == 1
        numbers = " ".join(map(str, extent))
        lines.append(f'<Piece Extent="{numbers}" Source="p&amp;{k}.vti"/>')
        if in_whole:
            data = (folder / f"p&{k}.vti").read_bytes()
            wide = data.replace(b'WholeExtent="%b"' % numbers.encode(), b'WholeExtent="%d %d %d %d %d %d"' % whole)
            assert wide != data
            written(folder / f"p&{k}.vti", wide)
    text = f'<VTKFile type="PImageData"><PImageData WholeExtent="{" ".join(map(str, whole))}">{"".join(lines)}'
    return written(folder / "a.pvti", f"{text}</PImageData></VTKFile>".encode())


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("in_whole", [False, True])
@pytest.mark.parametrize("is_cells", [False, True])
def test_pieces_are_put_together(tmp_path, is_cells, in_whole):
    path = write_pieces(tmp_path, is_cells=is_cells, in_whole=in_whole)
    volume = read(path)
    np.testing.assert_array_equal(volume.values, VALUES)
    np.testing.assert_array_equal(volume.spacing, [0.5, 2, 3])
    np.testing.assert_allclose(
        volume.world_from_index[:3, 3], np.array([11.0, 22, 30]) + np.array([0.25, 1, 1.5]) * is_cells
    )
    pieces = sorted(tmp_path.rglob("*.vti"))
    assert len(pieces) == 2 and header_and_voxel_files(path)[1] == pieces


@pytest.mark.usefixtures("one_process")
def test_pieces_that_are_missing_or_elsewhere(tmp_path):
    (tmp_path / "in").mkdir()
    path = write_pieces(tmp_path / "in")
    second = path.parent / "p&1.vti"
    data, piece = path.read_bytes(), second.read_bytes()
    written(second, piece[: len(piece) // 2])
    assert refused(path, match="this VTK file is damaged").where == str(second)
    second.unlink()
    assert refused(path, match="no such file").where == str(second)
    written(tmp_path / "b.vti", piece)
    refused(written(path, data.replace(b"p&amp;1", b"../b")), match="a piece of this image is outside of its folder")
    second.symlink_to(tmp_path / "b.vti")
    refused(written(path, data), match="a piece of this image is outside of its folder")
    second.unlink()
    second.symlink_to(second.name)  # to itself
    refused(path)
    second.unlink()
    alone = data.partition(b'<Piece Extent="4')[0] + b"</PImageData></VTKFile>"
    refused(written(path, alone), match="pieces without 24 of 60 voxels")
    refused(written(path, data.replace(b"p&amp;1", b"p&amp;0")), match="damaged|does not fit")


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize(
    "text", ['<VTKFile type="PolyData">', "# vtk DataFile Version 3.0\na\nASCII\nDATASET POLYDATA\n"]
)
def test_other_grids_are_named(tmp_path, text):
    error = refused(written(tmp_path / "a.vtk", text.encode()), match="a grid of another kind")
    assert error.got.upper() == "POLYDATA"
