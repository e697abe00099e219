"""Sort the arrays of a VTK image into components, and masks of points and cells that have no data.

The array of active scalars comes first. `vtkGhostType` hides points and cells, and filters that resample write
`vtkValidPointMask`; neither is a component.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.readers.statements import FormatTable, Statement
from renderer.scene import join_some, short_text
from renderer.volume import Bools

STATEMENTS = FormatTable(
    "VTK",
    (
        Statement("Origin", "place", "the place of the first point"),
        Statement("Spacing", "place", "the distance of points"),
        Statement("Direction", "place", "the directions of the axes"),
        Statement("WholeExtent", "place", "the first and the last index along each axis"),
        Statement("Coordinates", "place", "the places of points of a rectilinear grid"),
        Statement("Scalars", "values", "the array that is drawn by default"),
        Statement("ComponentName0", "meaning", "the name of a component; also ComponentName1 and so on"),
        Statement("UNITS_LABEL", "meaning", "the unit of the values"),
        Statement("vtkGhostType", "validity", "points and cells that are hidden"),
        Statement("vtkValidPointMask", "validity", "points outside of the grid that was resampled"),
        Statement("TimeValue", "meaning", "the time of the file; a collection .pvd has the times of several files",
                  is_applied=False),
        Statement("LOOKUP_TABLE", "meaning", "colours of the values", is_applied=False),
    ),
)  # fmt: skip

# The name of the mask of hidden points or cells.
_GHOSTS = "vtkGhostType"
# The name of the mask of valid points.
_VALID = "vtkValidPointMask"

# The bit of _GHOSTS that hides a point (vtkDataSetAttributes).
_HIDDEN_POINT = 2
# The bit of _GHOSTS that hides a cell.
_HIDDEN_CELL = 32


class Component(NamedTuple):
    """A component of the image: an array of VTK, and the number of a component of the array."""

    array: Any
    number: int

    @property
    def name(self) -> str:
        """Return the name of the array, with the name or the number of the component if the array has several."""
        name = short_text(self.array.GetName() or "an array without a name")
        if self.array.GetNumberOfComponents() == 1:
            return name
        return f"{name}[{short_text(self.array.GetComponentName(self.number) or str(self.number))}]"

    @property
    def unit(self) -> str:
        """Return the unit of the values; an empty text if the file has none."""
        from vtkmodules.vtkCommonCore import vtkDataArray

        return self.array.GetInformation().Get(vtkDataArray.UNITS_LABEL()) or ""


def arrays_of(fields: Any) -> list[Any]:
    """Return the arrays of numbers of points or cells. fields: a vtkPointData or vtkCellData."""
    return [each for k in range(fields.GetNumberOfArrays()) if (each := fields.GetArray(k)) is not None]


def components_of(fields: Any) -> list[Component]:
    """Return the components of points or cells, without masks; the active scalars come first.

    fields: a vtkPointData or vtkCellData.
    """
    active = fields.GetScalars()
    arrays = [each for each in arrays_of(fields) if each.GetName() not in (_GHOSTS, _VALID)]
    arrays.sort(key=lambda each: each is not active)
    return [Component(array, k) for array in arrays for k in range(array.GetNumberOfComponents())]


def notes_of(image: Any, component: Component, *, is_cells: bool) -> list[str | None]:
    """Return notes on fields of a file that are not applied, and on arrays that are left out; None is no note.

    is_cells: whether the values of cells are read, not those of points.
    """
    found = set()
    if image.GetFieldData().HasArray("TimeValue"):
        found.add("TimeValue")
    if component.array.GetLookupTable() is not None:
        found.add("LOOKUP_TABLE")
    names = list(dict.fromkeys(each.array.GetName() or "" for each in components_of(image.GetCellData())))
    of_cells = f"arrays of cells beside those of points are left out: {join_some([*map(short_text, names)])}"
    return [STATEMENTS.note(found), of_cells if names and not is_cells else None]


def hidden_voxels(image: Any, *, is_cells: bool) -> tuple[Bools | None, str | None]:
    """Return a mask of the points or cells without data, [z, y, x], and a note on its arrays; None without masks.

    A cell is hidden if one of its corners is, and a point if all of its cells are. Raises InputError for masks of
    another length.
    """
    num_points = tuple(image.GetDimensions()[::-1])
    num_cells = tuple(max(n - 1, 1) for n in num_points)
    points = _masked(image.GetPointData(), num_points, _HIDDEN_POINT)
    cells = _masked(image.GetCellData(), num_cells, _HIDDEN_CELL)
    names = sorted({name for name, _ in (*points, *cells)})
    if not names:
        return None, None
    of_points, of_cells = (
        np.logical_or.reduce([np.zeros(shape, bool), *(hidden for _, hidden in found)])
        for found, shape in ((points, num_points), (cells, num_cells))
    )
    hidden = of_cells | _any_corner(of_points) if is_cells else of_points | _all_cells(of_cells, num_points)
    return hidden, f"{'cells' if is_cells else 'points'} that {' and '.join(names)} hides have no data"


def _masked(fields: Any, shape: tuple[int, ...], bit: int) -> list[tuple[str, Bools]]:
    """Return the name and the values of each mask that hides any point or cell.

    fields: a vtkPointData or vtkCellData. shape: the shape of the masks. bit: the bit of vtkGhostType that hides.
    """
    return [(name, hidden) for name, hidden in _masks(fields, shape, bit) if hidden.any()]


def _masks(fields: Any, shape: tuple[int, ...], bit: int) -> Iterator[tuple[str, Bools]]:
    from vtkmodules.util.numpy_support import vtk_to_numpy

    for name in (_GHOSTS, _VALID):
        array = fields.GetArray(name)
        if array is None:
            continue
        numbers = vtk_to_numpy(array)
        if numbers.size != np.prod(shape):
            raise InputError(
                "a mask of this VTK file has another length than the image",
                got=f"{name} of {numbers.size} numbers",
                expected=str(np.prod(shape)),
            )
        hidden = numbers.astype(np.int64) & bit != 0 if name == _GHOSTS else numbers == 0
        yield name, hidden.reshape(shape)


def _any_corner(points: Bools) -> Bools:
    """Return which cells have a hidden corner. points: which points are hidden, [z, y, x]."""
    for axis, n in enumerate(points.shape):
        if n > 1:
            points = np.delete(points, -1, axis) | np.delete(points, 0, axis)
    return points


def _all_cells(cells: Bools, num_points: tuple[int, ...]) -> Bools:
    """Return which points have only hidden cells around them. cells: which cells are hidden, [z, y, x]."""
    for axis, n in enumerate(num_points):
        if n > 1:
            padding = [(1, 1) if k == axis else (0, 0) for k in range(3)]
            wide = np.pad(cells, padding, constant_values=True)
            cells = np.delete(wide, -1, axis) & np.delete(wide, 0, axis)
    return cells
