"""Tell the object from its surroundings, such as tables, holders, frames and specks, and clip these away.

The visible voxels fall into connected parts. The object is the main part, the largest one that is no sheet (a thin
part, such as a table), together with other parts that are not too small. Planes that touch the object clip away the
parts beyond them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from renderer.scene import ClipSpec, PlaneSpec, Vector
from renderer.statistics import VoxelSample, pool_voxels
from renderer.volume import Bools, Float64, Int64, grow, label_parts

# A connected part belongs to the object if its volume is at least this share of the volume of the main part, the
# largest one that is no sheet, such as a table. Smaller parts are specks, unless they are near the main part.
_MIN_VOLUME = 0.002
# A connected part is near the object's main part if the gap between them is less than twice this many cells.
_GAP = 2
# A connected part that touches a sheet, such as a table, belongs to the object if its volume is at least this share of
# the volume of the object's main part. Smaller parts are pieces of the sheet.
_MIN_VOLUME_AT_SHEET = 0.1
# A connected part is a sheet, such as a table, a holder or a frame, if it is thinner than this share of its diagonal
# and reaches the border of the volume. Plates have 0.03 to 0.06, a ball has 0.2.
_MAX_SHEET_THICKNESS = 0.09
# Planes that clip away at least this share of the visible cells are used.
_MIN_CLIPPED = 0.01
# Planes that shorten the diagonal of the visible cells by at least this share are used, however few cells they clip.
_MIN_SHRINKAGE = 0.1
# A part lies beside the object if at least this share of its cells lies beyond planes that touch the object; otherwise
# the part is within the object.
_MIN_BEYOND = 0.3
# Planes are used only if they leave at least this share of the visible cells. A thin part that is too large to be
# clipped away belongs to the object, such as the plate on an engine.
_MIN_LEFT = 0.35
# The ends of the visible part along an axis are these percentiles of its cells' positions, so that a few outermost
# cells do not count.
_OUTERMOST = (2, 98)
# A holder, such as a tube around the object, has one cross-section from end to end of the volume: a row of cells along
# an axis is in a holder if at least this share of its cells is visible.
_MIN_FILLED = 0.95
# Holders of the object, such as tubes, are looked for only along axes on which the volume has at least this many
# cells.
_MIN_LENGTH = 16
# A thin part is a sheet, such as a table, only if its second longest side is at least this many times its thickness.
# Rods are no sheets: by volume and surface, they are about twice as wide as thick.
_MIN_WIDTH = 5.0
# The largest number of planes that clip surroundings away. It leaves most of a scene's clip planes to the user.
_MOST_PLANES = 6
# The directions in which clip planes may face, as vectors of small whole numbers.
_DIRECTIONS = np.array([each for each in product(range(-2, 3), repeat=3) if math.gcd(*each) == 1], np.float64)
# The unit vectors of `_DIRECTIONS`.
_NORMALS = _DIRECTIONS / np.linalg.norm(_DIRECTIONS, axis=1, keepdims=True)


class Plane(NamedTuple):
    """A plane in the world: a point on it, relative to the volume's centre, and its normal, away from the object."""

    point: Float64
    normal: Float64


def separating_planes(sample: VoxelSample, is_visible: Bools) -> list[Plane]:
    """Return up to six planes that clip away the surroundings of the object.

    is_visible: which of the sample's voxels are visible, bool [z, y, x].
    """
    if not is_visible.any():
        return []
    cells, sides = pool_voxels(is_visible, sample.spacing)
    holders = _are_holders(cells, sides)
    parts = _measure_parts(cells, np.where(holders, label_parts(holders), label_parts(cells & ~holders)), sides)
    axes = sample.directions * sides[::-1]
    places = np.argwhere(cells)[:, ::-1] + 0.5 - np.array(cells.shape[::-1]) / 2
    heights, reach = places @ axes.T @ _NORMALS.T, np.abs(_NORMALS @ axes).sum(axis=1) / 2
    is_kept = _are_of_object(cells, parts)
    # A connected part of which little lies beyond the planes is not beside the object, but within it.
    is_beyond = (heights > _limits(heights, is_kept[parts.of_cell], reach)).any(axis=1)
    is_kept |= np.bincount(parts.of_cell, is_beyond) < _MIN_BEYOND * np.bincount(parts.of_cell)
    return _touching_planes(places @ axes.T, heights, _limits(heights, is_kept[parts.of_cell], reach))


def _limits(heights: Float64, of_object: Bools, reach: Float64) -> Float64:
    """Return how far the object reaches along each normal.

    heights: the positions of all cells' centres along each normal, [cells, normals]. of_object: which cells belong to
    the object. reach: how far a cell reaches from its centre along each normal.
    """
    return np.asarray(heights[of_object].max(axis=0) + reach)


def corner_box(sample: VoxelSample, is_visible: Bools) -> tuple[Float64, Float64]:
    """Return the lowest and the highest corner of a box around one eighth of the visible part: right, front and top.

    Corners are in the world, relative to the volume's centre.
    """
    spacing, shape = np.array(sample.spacing[::-1]), np.array(is_visible.shape[::-1])
    ends = np.percentile(np.argwhere(is_visible)[:, ::-1], _OUTERMOST, axis=0)
    x, y, z = sample.directions @ ((ends.mean(axis=0) + 0.5 - shape / 2) * spacing)
    far = 1.01 * np.abs(sample.directions) @ (shape * spacing / 2)
    return np.array([x, -far[1], z]), np.array([far[0], y, far[2]])


def clip_specs(
    planes: Sequence[Plane], corner: tuple[Float64, Float64] | None, centre: Float64, diagonal: float
) -> tuple[ClipSpec, ...]:
    """Return the planes, and the box of a clipped corner, as a scene has them: rounded to a thousandth of the diagonal.

    centre: the volume's centre in the world.
    """
    clip = [ClipSpec(plane=PlaneSpec(_rounded(at + centre, diagonal), _rounded(normal, 1.0))) for at, normal in planes]
    if corner is not None:
        low, high = (_rounded(end + centre, diagonal) for end in corner)
        clip.append(ClipSpec(box=(low, high)))
    return tuple(clip)


def _rounded(vector: Float64, extent: float) -> Vector:
    decimals = 3 - math.floor(math.log10(extent))
    x, y, z = (round(at, decimals) + 0.0 for at in vector.tolist())
    return x, y, z


def are_beyond(sample: VoxelSample, planes: Sequence[Plane]) -> Bools:
    """Return which of the sample's voxels the planes clip away, bool [z, y, x]."""
    found = np.zeros(sample.normalized.shape, bool)
    sides = zip(sample.normalized.shape, sample.spacing, strict=True)
    places = [(np.arange(num) + 0.5 - num / 2) * side for num, side in sides]
    for plane in planes:
        slopes = (plane.normal @ sample.directions)[::-1]
        z, y, x = (at * slope for at, slope in zip(places, slopes, strict=True))
        found |= z[:, None, None] + y[:, None] + x > plane.point @ plane.normal
    return found


def _are_holders(cells: Bools, sides: Float64) -> Bools:
    """Return which cells belong to holders: thin parts with one cross-section from end to end of the volume.

    Holders may touch the object.
    """
    extruded = np.zeros_like(cells)
    for axis in range(3):
        if cells.shape[axis] >= _MIN_LENGTH:
            extruded |= grow(cells.mean(axis, keepdims=True) >= _MIN_FILLED, 1) & cells
    middle = np.argwhere(cells).mean(axis=0)
    parts = _measure_parts(extruded, label_parts(extruded), sides)
    is_around = ((parts.low <= middle) & (middle < parts.high)).all(axis=1)
    sizes = (parts.high - parts.low) * sides
    is_rod = np.sort(sizes, axis=1)[:, 1] < _MIN_WIDTH * parts.thickness * np.linalg.norm(sizes, axis=1)
    extruded[extruded] = (parts.is_sheet & ~is_around & ~is_rod)[parts.of_cell]
    return extruded


class _Parts(NamedTuple):
    """The measurements of the connected parts of the visible cells.

    of_cell: the number of each cell's part.
    volumes: the volume of each part.
    thickness: the thickness of each part, as a share of its diagonal.
    low, high: the ends of each part along z, y, x, in cells.
    is_sheet: whether a part is thin and reaches the border.
    """

    of_cell: Int64
    volumes: Float64
    thickness: Float64
    low: Int64
    high: Int64
    is_sheet: Bools


def _measure_parts(cells: Bools, labels: Int64, sides: Float64) -> _Parts:
    _, of_cell, counts = np.unique(labels[cells], return_inverse=True, return_counts=True)
    volumes, num = counts * sides.prod(), len(counts)
    padded = np.pad(cells, 1)
    surfaces = np.zeros(num)
    for axis in range(3):
        for step in (-1, 1):
            is_open = ~np.roll(padded, step, axis)[1:-1, 1:-1, 1:-1][cells]
            surfaces += np.bincount(of_cell, is_open, num) * sides.prod() / sides[axis]
    places = np.argwhere(cells)
    low, high = np.full((num, 3), cells.size), np.zeros((num, 3), np.int64)
    np.minimum.at(low, of_cell, places)
    np.maximum.at(high, of_cell, places + 1)
    thickness = 2 * volumes / surfaces / np.linalg.norm((high - low) * sides, axis=1)
    is_sheet = (thickness < _MAX_SHEET_THICKNESS) & ((low == 0) | (high == cells.shape)).any(axis=1)
    return _Parts(of_cell, volumes, thickness, low, high, is_sheet)


def _are_of_object(cells: Bools, parts: _Parts) -> Bools:
    """Return which connected parts belong to the object."""
    of_cell, num = parts.of_cell, len(parts.volumes)
    main = int((parts.volumes * parts.thickness).argmax())
    sheets = np.zeros_like(cells)
    sheets[cells] = parts.is_sheet[of_cell] & (of_cell != main)
    # Cells grow, so that the pieces of a broken thin structure, such as an insect's leg or a vessel, belong together.
    # The cells of sheets, such as tables, are left out: through them, broken pieces of a sheet would join the object.
    grown = label_parts(grow(cells & ~sheets, _GAP))[cells]
    is_near = np.bincount(of_cell, grown == grown[of_cell == main][0], num) > 0
    of_sheet = np.bincount(of_cell, grow(sheets, 1)[cells], num) > 0
    share = parts.volumes / parts.volumes[main]
    is_kept = np.where(of_sheet, share >= _MIN_VOLUME_AT_SHEET, is_near | (share >= _MIN_VOLUME)) & ~parts.is_sheet
    is_kept[main] = True
    return np.asarray(is_kept)


def _touching_planes(points: Float64, heights: Float64, limits: Float64) -> list[Plane]:
    """Return planes that touch the object, the plane that clips most cells first.

    points: the centres of all cells, float64 [n, 3]. heights: the positions of these centres along each normal. limits:
    how far the object reaches along each normal. Returns no planes if they clip too few cells to be worth it, or too
    many.
    """
    is_beyond, is_left, chosen = heights > limits, np.ones(len(points), bool), list[int]()
    while len(chosen) < _MOST_PLANES:
        counts = is_beyond[is_left].sum(axis=0)
        if not counts.max():
            break
        chosen.append(int(counts.argmax()))
        is_left &= ~is_beyond[:, chosen[-1]]
    before, after = (float(np.linalg.norm(np.ptp(part, axis=0))) for part in (points, points[is_left]))
    is_worth_it = np.mean(~is_left) >= _MIN_CLIPPED or after <= (1 - _MIN_SHRINKAGE) * before
    if not is_worth_it or np.mean(is_left) < _MIN_LEFT:
        return []
    return [Plane(limits[k] * _NORMALS[k], _DIRECTIONS[k]) for k in chosen]
