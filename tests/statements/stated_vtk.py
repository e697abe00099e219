"""Samples of VTK images."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from statement_samples import Sample, Samples, Writer
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonCore import vtkDataArray, vtkLookupTable
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkRectilinearGrid
from vtkmodules.vtkIOLegacy import vtkStructuredPointsWriter
from vtkmodules.vtkIOXML import vtkXMLImageDataWriter, vtkXMLRectilinearGridWriter

from renderer.volume import Array

VALUES: Array = np.arange(24, dtype=np.float32).reshape(2, 3, 4)


def vtk_array(name: str, values: Array) -> Any:
    """Return an array of VTK of values [z, y, x] or [z, y, x, component]."""
    array = numpy_to_vtk(np.ascontiguousarray(values).reshape(-1, *values.shape[3:]), deep=True)
    array.SetName(name)
    return array


def write_vtk(
    path: Path,
    points: Mapping[str, Array] | None = None,
    cells: Mapping[str, Array] | None = None,
    dimensions: Sequence[int] = (4, 3, 2),
    change: Callable[[Any], object] = lambda image: None,
) -> Path:
    """Write arrays of points and cells as an image. change: what is done to the image before it is written."""
    image = vtkImageData()
    image.SetDimensions(*dimensions)
    for fields, arrays in ((image.GetPointData(), points), (image.GetCellData(), cells)):
        for name, values in (arrays or {}).items():
            fields.AddArray(vtk_array(name, values))
    change(image)
    writer: Any = vtkXMLImageDataWriter() if path.suffix == ".vti" else vtkStructuredPointsWriter()
    writer.SetFileName(str(path))
    writer.SetInputData(image)
    assert writer.Write() == 1
    return path


def _image(change: Callable[[Any], object] = lambda image: None, name: str = "a.vti", **more: Array) -> Writer:
    return lambda folder: write_vtk(folder / name, {"T": VALUES, **more}, change=change)


def _sample(change: Callable[[Any], object], name: str = "a.vti") -> Sample:
    return Sample(_image(name=name), _image(change, name))


def _grid(step: float) -> Writer:
    def write(folder: Path) -> Path:
        grid = vtkRectilinearGrid()
        grid.SetDimensions(4, 3, 2)
        for axis, n in zip("XYZ", (4, 3, 2), strict=True):
            getattr(grid, f"Set{axis}Coordinates")(numpy_to_vtk(np.arange(n) * step, deep=True))
        grid.GetPointData().AddArray(vtk_array("T", VALUES))
        writer = vtkXMLRectilinearGridWriter()
        writer.SetFileName(str(folder / "a.vtr"))
        writer.SetInputData(grid)
        assert writer.Write() == 1
        return folder / "a.vtr"

    return write


def _first(image: Any) -> Any:
    return image.GetPointData().GetArray(0)


def _set_colors(image: Any) -> None:
    table = vtkLookupTable()
    table.SetNumberOfTableValues(4)
    table.Build()
    _first(image).SetLookupTable(table)
    image.GetPointData().SetActiveScalars("T")


_MASK = np.zeros((2, 3, 4), np.uint8)
_MASK[0, 1, 2] = 2

SAMPLES: Samples = {
    "VTK": {
        "Origin": _sample(lambda image: image.SetOrigin(5, 0, 0)),
        "Spacing": _sample(lambda image: image.SetSpacing(1, 1, 2)),
        "Direction": _sample(lambda image: image.SetDirectionMatrix(0, 1, 0, 1, 0, 0, 0, 0, 1)),
        "WholeExtent": _sample(lambda image: image.SetExtent(5, 8, 0, 2, 0, 1)),
        "Coordinates": Sample(_grid(1.0), _grid(2.0)),
        "Scalars": Sample(
            _image(p=VALUES + 1), _image(lambda image: image.GetPointData().SetActiveScalars("p"), p=VALUES + 1)
        ),
        "ComponentName0": Sample(
            lambda folder: write_vtk(folder / "a.vti", {"v": np.stack([VALUES] * 2, -1)}),
            lambda folder: write_vtk(
                folder / "a.vti",
                {"v": np.stack([VALUES] * 2, -1)},
                change=lambda image: _first(image).SetComponentName(0, "east"),
            ),
        ),
        "UNITS_LABEL": _sample(lambda image: _first(image).GetInformation().Set(vtkDataArray.UNITS_LABEL(), "K")),
        "vtkGhostType": Sample(_image(vtkGhostType=_MASK * 0), _image(vtkGhostType=_MASK)),
        "vtkValidPointMask": Sample(
            _image(vtkValidPointMask=np.ones_like(_MASK)), _image(vtkValidPointMask=1 - _MASK // 2)
        ),
        "TimeValue": _sample(lambda image: image.GetFieldData().AddArray(vtk_array("TimeValue", np.array([2.5])))),
        "LOOKUP_TABLE": _sample(_set_colors, "a.vtk"),
    }
}
