"""Read VTK images: XML (.vti) and legacy (.vtk) files of image data, by VTK, in a child process (`isolation.py`).

Each component of each array is a component of the volume. Values of points are preferred to those of cells, which lie
in the middle between points.
"""

from __future__ import annotations

import math
import mmap
import re
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError, require_package
from renderer.readers.common import Image, affine, check_dtype, choice_notes, select_index
from renderer.readers.isolation import Host, allocate_voxels
from renderer.scene import short_text

_MAX_PACKING = 1032  # of deflate


def read_vtk(path: Path, time: int | None, component: int | None, *, has_spacing_override: bool, host: Host) -> Image:
    """Read one component of one array of an image.

    has_spacing_override: not used; the file always has lengths. Raises InputError for files that are truncated or hold
        other data, and if `time` or `component` do not fit.
    """
    require_package("vtkmodules", extra="vtk")
    select_index("time", time, 1)
    image = _read(path, host)
    fields = image.GetPointData()
    is_cells = fields.GetNumberOfArrays() == 0
    if is_cells:
        fields = image.GetCellData()
    components = [(array, k) for array in _arrays(fields) for k in range(array.GetNumberOfComponents())]
    shape = tuple(max(n - is_cells, 1) for n in image.GetDimensions())
    if not components or 0 in image.GetDimensions():
        raise _damaged("no values")
    names = [_name(*each) for each in components]
    array, channel = components[select_index("component", component, len(components))]
    from vtkmodules.util.numpy_support import vtk_to_numpy

    stored = vtk_to_numpy(array)
    check_dtype(stored.dtype)
    values = allocate_voxels(host, shape[::-1], stored.dtype)
    if array.GetNumberOfTuples() != int(np.prod(shape, dtype=object)):
        raise _damaged(f"{array.GetNumberOfTuples()} values of {short_text(array.GetName())}")
    values[...] = (stored if stored.ndim == 1 else stored[:, channel]).reshape(values.shape)
    notes = choice_notes("c", (len(names),), time, component, names)
    return Image(values, _world_from_index(image, is_cells=is_cells), notes)


def _name(array: Any, component: int) -> str:
    name = short_text(array.GetName() or "an array without a name")
    return name if array.GetNumberOfComponents() == 1 else f"{name}[{component}]"


def _read(path: Path, host: Host) -> Any:
    """Return a vtkImageData; raises InputError for any other content, and for errors that VTK reports."""
    from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

    with path.open("rb") as file:
        is_legacy = file.read(5) == b"# vtk"
    reader: Any
    if is_legacy:
        from vtkmodules.vtkIOLegacy import vtkStructuredPointsReader

        reader = vtkStructuredPointsReader()
        reader.ReadAllScalarsOn()
        reader.ReadAllVectorsOn()
        reader.ReadAllFieldsOn()
    else:
        from vtkmodules.vtkIOXML import vtkXMLImageDataReader

        reader = vtkXMLImageDataReader()
    reader.SetFileName(str(path))
    errors: list[str] = []
    reader.AddObserver("ErrorEvent", lambda *_: errors.append(""))
    window, before = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(window)
    try:
        if not is_legacy:  # which may be compressed
            reader.UpdateInformation()
            host.expect_bytes(min(_num_bytes(reader), _MAX_PACKING * path.stat().st_size))
        reader.Update()
    finally:
        vtkOutputWindow.SetInstance(before)
    image = reader.GetOutput()
    # Of a truncated legacy file VTK only warns, and not its observers.
    is_damaged = bool(errors) or reader.GetErrorCode() != 0 or "Error reading" in window.GetOutput()
    if is_damaged or image is None or image.GetDimensions() == (0, 0, 0):
        raise _damaged(None)
    if not is_legacy:
        _check_appended(path, image)
    return image


def _check_appended(path: Path, image: Any) -> None:
    """Raise InputError unless a file has its end, and plain values behind its XML are all there.

    VTK goes on with whatever there is in memory.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if data.rfind(b"</VTKFile>") < 0:
            raise _damaged("a file that breaks off")
        plain = re.search(rb"<AppendedData[^<>]*encoding\s*=\s*[\"']raw[^<>]*>\s*_", data)
        if plain is None or b"compressor" in data[: plain.start()]:
            return
        found = data.rfind(b"</AppendedData>") - plain.end()
    fields = [each for part in (image.GetPointData(), image.GetCellData()) for each in _arrays(part)]
    expected = sum(each.GetNumberOfValues() * each.GetDataTypeSize() for each in fields)
    if found < expected:
        raise _damaged(f"{max(found, 0)} bytes of values, of {expected}")


def _arrays(fields: Any) -> list[Any]:
    return [each for k in range(fields.GetNumberOfArrays()) if (each := fields.GetArray(k)) is not None]


def _num_bytes(reader: Any) -> int:
    """Return more than the bytes of all arrays that an XML reader has found: those of tensors of float64."""
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline

    extent = reader.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.WHOLE_EXTENT()) or (0,) * 6
    num_points: int = math.prod(last - first + 1 for first, last in zip(extent[::2], extent[1::2], strict=True))
    num_arrays = int(reader.GetNumberOfPointArrays()) + int(reader.GetNumberOfCellArrays())
    return 9 * 8 * num_points * num_arrays


def _damaged(got: str | None) -> InputError:
    return InputError(
        "this VTK file is damaged, or holds no image",
        got=got,
        expected="image data (STRUCTURED_POINTS in legacy files) with values at its points or in its cells",
        hint="grids of other kinds are resampled to an image first, for instance in ParaView",
    )


def _world_from_index(image: Any, *, is_cells: bool) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return the affine, float64 [4, 4], of the first voxel of the image, which may be a part of a larger one."""
    matrix = image.GetDirectionMatrix()
    direction = np.array([[matrix.GetElement(i, j) for j in range(3)] for i in range(3)])
    world_from_index = affine(image.GetSpacing(), image.GetOrigin(), direction)
    first = np.array(image.GetExtent()[::2]) + (0.5 if is_cells else 0.0)
    world_from_index[:3, 3] += world_from_index[:3, :3] @ first
    return world_from_index
