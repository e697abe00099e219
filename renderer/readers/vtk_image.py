"""Read VTK images: XML (.vti, .vtr) and legacy (.vtk) files, by VTK, in a child process (`isolation.py`).

The files hold image data, or rectilinear grids with even coordinates. The pieces of a parallel image (.pvti) are files
in its folder, which are put together.

Each component of each array is a component of the volume. If a file has values at points and values of cells, the
points are read. The value of a cell lies at its centre. Points and cells that a mask hides (`vtk_arrays.py`) have no
data.
"""

from __future__ import annotations

import importlib
import math
import mmap
import os
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError, require_package
from renderer.readers.affines import affine, even_steps
from renderer.readers.components import choose, select_index
from renderer.readers.file_errors import errors_about, require_exists
from renderer.readers.image import Image
from renderer.readers.isolation import Host, allocate_voxels
from renderer.readers.nodata import with_nan_where
from renderer.readers.text_header import MAX_HEADER_BYTES
from renderer.readers.units import units_of
from renderer.readers.vtk_arrays import arrays_of, components_of, hidden_voxels, notes_of
from renderer.readers.vtk_text import extent_in, fault_in
from renderer.scene import short_text
from renderer.system import attribute, unescaped
from renderer.volume import Array, Bools, Float64

# The largest ratio of decompressed to compressed bytes that deflate, the usual compression of VTK, can reach.
_MAX_PACKING = 1032
# The largest number of pieces of a parallel image.
_MAX_PIECES = 10_000
# The module and the class of VTK's reader for each kind of data. Legacy files spell their kinds in capital letters.
_READERS = {
    "ImageData": ("vtkIOXML", "vtkXMLImageDataReader"),
    "RectilinearGrid": ("vtkIOXML", "vtkXMLRectilinearGridReader"),
    "STRUCTURED_POINTS": ("vtkIOLegacy", "vtkStructuredPointsReader"),
    "RECTILINEAR_GRID": ("vtkIOLegacy", "vtkRectilinearGridReader"),
}
# The hint of errors about grids of kinds that are not read.
_RESAMPLE = "grids of other kinds are resampled to an image first, for instance by ParaView's filter Resample To Image"


def read_vtk(path: Path, time: int | None, component: int | None, *, has_spacing_override: bool, host: Host) -> Image:
    """Read one component of one array of an image.

    has_spacing_override: has no effect, as the file always has lengths. Raises InputError for files that are truncated
        or hold other data, and if `time` or `component` do not fit.
    """
    require_package("vtkmodules", extra="vtk")
    select_index("time", time, 1)
    pieces = _pieces(path)
    if pieces:
        part = _assembled(path, pieces, component, host)
    else:
        part = _read_part(path, component, host)
        values = allocate_voxels(host, part.values.shape, part.values.dtype)
        values[...] = part.values
        part = replace(part, values=values)
    chosen = choose("c", (len(part.names),), None, component, part.names)
    values = part.values if part.hidden is None else with_nan_where(
        part.values, part.hidden, lambda shape, dtype: allocate_voxels(host, shape, dtype)
    )  # fmt: skip
    notes = (*part.notes, *chosen.notes)
    return Image(values, part.world_from_index, notes, channels=chosen.channels, units=units_of(value=part.unit))


@dataclass(frozen=True)
class _Part:
    """One component of an image, or of a piece of an image.

    values: the values, [z, y, x]. names: the names of all components. is_cells: whether the values belong to cells.
    first: the indices of the first voxel in the whole image. unit: the unit of the values. hidden: a mask of the voxels
    without data, [z, y, x], or None.
    """

    values: Array
    names: list[str]
    is_cells: bool
    first: tuple[int, ...]
    world_from_index: Float64
    unit: str
    hidden: Bools | None
    notes: tuple[str | None, ...]


def _read_part(path: Path, component: int | None, host: Host, extent: tuple[int, ...] = ()) -> _Part:
    image = _read(path, host, extent)
    components = components_of(image.GetPointData())
    is_cells = not components
    if is_cells:
        components = components_of(image.GetCellData())
    shape = tuple(max(n - is_cells, 1) for n in image.GetDimensions())
    if not components or 0 in image.GetDimensions():
        raise _damaged("no values")
    fault = None if _is_legacy(path) else fault_in(path, image, is_cells=is_cells)
    if fault is not None:
        raise _damaged(fault)
    own = components[select_index("component", component, len(components))]
    from vtkmodules.util.numpy_support import vtk_to_numpy

    stored = vtk_to_numpy(own.array).reshape(*shape[::-1], own.array.GetNumberOfComponents())
    hidden, note = hidden_voxels(image, is_cells=is_cells)
    return _Part(
        stored[..., own.number],
        [each.name for each in components],
        is_cells,
        tuple(image.GetExtent()[::2]),
        _world_from_index(image, is_cells=is_cells),
        own.unit,
        hidden,
        (note, *notes_of(image, own, is_cells=is_cells)),
    )


def _assembled(path: Path, pieces: list[tuple[Path, tuple[int, ...]]], component: int | None, host: Host) -> _Part:
    """Return the image of all pieces; raises InputError for voxels in no piece, and for pieces that do not fit."""
    whole = _extent(re.search(r"<PImageData\b[^<>]*", _start(path)), "WholeExtent")
    made, is_there, is_shown, notes = None, np.zeros(0, bool), np.zeros(0, bool), dict[str | None, None]()
    for file, extent in pieces:
        host.begin_file(file)
        with errors_about(file):
            part = _read_part(file, component, host, extent)
            if made is None:
                shape = tuple(max(whole[k + 1] - whole[k] + (not part.is_cells), 1) for k in (4, 2, 0))
                values = allocate_voxels(host, shape, part.values.dtype)
                is_there, is_shown = np.zeros(shape, bool), np.zeros(shape, bool)
                world_from_index = part.world_from_index.copy()
                world_from_index[:3, 3] += world_from_index[:3, :3] @ np.subtract(whole[::2], part.first)
                made = replace(part, values=values, world_from_index=world_from_index)
            begins = np.subtract(part.first, whole[::2])[::-1]
            place = tuple(slice(at, at + n) for at, n in zip(begins, part.values.shape, strict=True))
            is_inside = min(begins) >= 0 and made.values[place].shape == part.values.shape
            is_alike = (part.values.dtype, part.names, part.is_cells) == (made.values.dtype, made.names, made.is_cells)
            has_same_steps = np.allclose(part.world_from_index[:3, :3], made.world_from_index[:3, :3])
            if not (is_inside and is_alike and has_same_steps):
                raise InputError(
                    "this piece does not fit the others of its image",
                    expected="the arrays and the spacing of the first piece, and a place inside the whole extent",
                )
            # Pieces overlap: a voxel that one piece hides may be shown by another piece.
            shown = np.ones(part.values.shape, bool) if part.hidden is None else ~part.hidden
            np.copyto(made.values[place], part.values, where=shown)
            is_there[place] = True
            is_shown[place] |= shown
            notes |= dict.fromkeys(part.notes)
    assert made is not None, "called without pieces"
    if not is_there.all():
        raise _damaged(f"pieces without {np.count_nonzero(~is_there)} of {is_there.size} voxels")
    return replace(made, hidden=None if is_shown.all() else ~is_shown, notes=tuple(notes))


def piece_files(path: Path) -> list[Path]:
    """Return the files of the pieces that a parallel image names; an empty list for any other file."""
    return [file for file, _ in _pieces(path)]


def _pieces(path: Path) -> list[tuple[Path, tuple[int, ...]]]:
    """Return the files of the pieces that a parallel image names, and the extent of each piece.

    Returns an empty list for any other file. Raises InputError for a piece that is missing, or not in the folder of the
    image.
    """
    text = _start(path)
    if _kind(text) != "PImageData":
        return []
    pieces, folder = [], os.path.realpath(path.parent)
    for piece in re.finditer(r"<Piece\b[^<>]*", text):
        source = unescaped(attribute(piece[0], "Source") or "")
        file = path.parent / source
        if not source or "\0" in source or not Path(os.path.realpath(file)).is_relative_to(folder):
            raise InputError(
                "a piece of this image is outside of its folder", got=short_text(source), expected="a file beside it"
            )
        pieces.append((require_exists(file), _extent(piece, "Extent")))
        if len(pieces) > _MAX_PIECES:
            raise InputError("this image has too many pieces", expected=f"at most {_MAX_PIECES}")
    if not pieces:
        raise _damaged("no pieces")
    return pieces


def _extent(tag: re.Match[str] | None, name: str) -> tuple[int, ...]:
    """Return the first and the last point along each axis that a tag's attribute gives.

    Raises InputError for an invalid attribute.
    """
    extent = extent_in(tag[0], name) if tag else None
    if extent is None:
        raise _damaged(f"no {name} of six numbers")
    return extent


def _start(path: Path) -> str:
    with path.open("rb") as file:
        return file.read(MAX_HEADER_BYTES).decode("utf-8", "replace")


def _kind(start: str) -> str:
    """Return the kind of data that a file states; an empty text if it states none."""
    if start.startswith("# vtk"):  # the second line may hold any text
        lines = (line.upper().split(maxsplit=2) for line in start.split("\n")[2:])
        return next((words[1] for words in lines if words[:1] == ["DATASET"] and len(words) > 1), "")
    root = re.search(r"<VTKFile\b[^<>]*", start)
    return (root and attribute(root[0], "type")) or ""


def _is_legacy(path: Path) -> bool:
    return _start(path).startswith("# vtk")


def _read(path: Path, host: Host, extent: tuple[int, ...]) -> Any:
    """Return a vtkImageData or a vtkRectilinearGrid; raises InputError for other data, and for errors of VTK.

    extent: the extent of the part to read; an empty one reads everything.
    """
    from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

    kind = _kind(_start(path)[:4096])
    if kind not in _READERS:
        raise InputError(
            "this VTK file has a grid of another kind",
            got=kind or "no word on its kind",
            expected="image data, or a rectilinear grid whose coordinates are even",
            hint=_RESAMPLE,
        )
    module, name = _READERS[kind]
    reader = getattr(importlib.import_module(f"vtkmodules.{module}"), name)()
    reader.SetFileName(str(path))
    is_legacy = _is_legacy(path)
    window, before = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    vtkOutputWindow.SetInstance(window)
    try:
        if is_legacy:
            reader.ReadAllScalarsOn()
            reader.ReadAllVectorsOn()
            reader.ReadAllFieldsOn()
        else:  # an XML file, perhaps with compression
            reader.UpdateInformation()
            host.expect_bytes(min(_num_bytes(reader), _MAX_PACKING * path.stat().st_size))
        reader.UpdateExtent(extent) if extent else reader.Update()
    finally:
        vtkOutputWindow.SetInstance(before)
    image = reader.GetOutput()
    # VTK only warns of a truncated legacy file.
    is_damaged = reader.GetErrorCode() != 0 or re.search("ERROR: In|Error reading", window.GetOutput())
    if is_damaged or image is None or image.GetDimensions() == (0, 0, 0):
        raise _damaged(None)
    if not is_legacy:
        _check_appended(path, image)
    return image


def _check_appended(path: Path, image: Any) -> None:
    """Raise InputError unless a file ends properly, with all plain values behind its XML.

    VTK itself would go on with random values from memory.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        if data.rfind(b"</VTKFile>") < 0:
            raise _damaged("a file that breaks off")
        element = re.search(rb"<AppendedData\b[^<>]*>", data)
        begin = None if element is None else re.compile(rb"\s*_").match(data, element.end())
        if element is None or begin is None or b"compressor" in data[: element.start()]:
            return
        if attribute(element[0].decode("utf-8", "replace"), "encoding") != "raw":
            return
        found = data.rfind(b"</AppendedData>") - begin.end()
    fields = [each for part in (image.GetPointData(), image.GetCellData()) for each in arrays_of(part)]
    expected = sum(each.GetNumberOfValues() * each.GetDataTypeSize() for each in fields)
    if found < expected:
        raise _damaged(f"{max(found, 0)} bytes of values, of {expected}")


def _num_bytes(reader: Any) -> int:
    """Return an upper bound for the bytes of all arrays of an XML reader: each may be a tensor of float64."""
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
        hint=_RESAMPLE,
    )


def _world_from_index(image: Any, *, is_cells: bool) -> Float64:
    """Return the affine from voxel indices to the world, float64 [4, 4].

    image: a VTK image or grid, or a part of a larger one. The first voxel of the part has the index 0.
    """
    first = np.full(3, 0.5 if is_cells else 0.0)
    if image.IsA("vtkRectilinearGrid"):
        coordinates = (image.GetXCoordinates(), image.GetYCoordinates(), image.GetZCoordinates())
        origin, spacing = zip(*map(_even_steps, coordinates, "xyz"), strict=True)
        world_from_index = affine(spacing, origin, np.eye(3))
    else:
        matrix = image.GetDirectionMatrix()
        direction = np.array([[matrix.GetElement(i, j) for j in range(3)] for i in range(3)])
        world_from_index = affine(image.GetSpacing(), image.GetOrigin(), direction)
        first += image.GetExtent()[::2]
    world_from_index[:3, 3] += world_from_index[:3, :3] @ first
    return world_from_index


def _even_steps(coordinates: Any, axis: str) -> tuple[float, float]:
    """Return the first coordinate and the step along an axis of a grid; raises InputError unless they are even."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    even = even_steps(vtk_to_numpy(coordinates))
    if even is None:
        raise InputError(
            "the coordinates of this grid are not even",
            got=f"those along {axis}",
            expected="equal steps, as voxels have",
            hint=_RESAMPLE,
        )
    return even
