"""Average the matter of all layers over the cells of one grid in the world.

The grid has the axes of the world, covers all visible matter, and has one empty cell beyond each border. The widths and
the corners of its cells are multiples of steps, so that cells keep their places where the visible matter grows a little
from one frame to the next.

The light grid of occlusion and shadow (`light_grid.py`) is another grid. It belongs to one volume and turns with it; it
leaves out the first two cells, and looks as far as a radius; it takes a twentieth of the time.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from renderer.kernels import ThreadPool, kernels
from renderer.transfer import TransferFunction, raw_voxels, visibility_breakpoints
from renderer.volume import Array, Bools, Float32, Float64, Volume

# The number that divides the padded length of a row, as in renderer/kernels/sources/lighting/layouts.h.
ROW_CELLS = 16
# The number of places along an axis of a voxel at which matter is averaged. With 2, at most 4 in a cell, an engine of
# sharp walls was within 31.9 dB of Monte Carlo, with 3 within 35.5, and with 4, at most 8, within 36.3; they took 0.25,
# 1.0 and 1.7 s.
_PLACES_PER_VOXEL = 3
# The largest number of places along an axis of a cell.
_MAX_PLACES = 6
# The number of widths of cells between two powers of two, in the finest spacing. With 16, cells are up to 6 percent
# wider than they need be.
_WIDTHS_PER_OCTAVE = 16
# The number of places along an axis of a cell that clip planes and boxes are asked for.
_CLIP_PLACES = 4


class Matter(NamedTuple):
    """A layer of matter."""

    volume: Volume
    # The transfer function, with linear albedos as colours (`albedos_of`).
    transfer: TransferFunction
    # The factor on extinctions.
    weight: float = 1.0
    # Tells which boxes are clipped away, as in `compute_light_grid`.
    are_removed: Callable[[Float64], Bools] | None = None
    # [n, 3]: points in the world, in whose box all visible matter lies; no points if nothing is visible. None stands
    # for the corners of the volume.
    reach: Float64 | None = None

    @property
    def is_visible(self) -> bool:
        """Return whether anything of the layer may be visible."""
        return self.weight > 0 and (self.reach is None or len(self.reach) > 0)


class MatterGrid(NamedTuple):
    """The matter in the cells of a grid."""

    # [3]: the lowest corner of the grid (x, y, z), in the world.
    origin: Float64
    # The width of a cell, in the world.
    cell: float
    # The number of cells along x, y, z.
    shape_xyz: tuple[int, int, int]
    # [4, z, y, x]: the mean albedo times optical depth (r, g, b), and the mean optical depth, on a path through one
    # cell. Rows are padded with empty cells to a multiple of ROW_CELLS.
    cells: Float32


def place_grid(
    layers: Sequence[Matter], cell_voxels: float, max_cells: int
) -> tuple[Float64, float, tuple[int, int, int]]:
    """Return where the grid lies over all visible matter: `origin`, `cell` and `shape_xyz` of a MatterGrid.

    cell_voxels: the width of a cell, in the finest spacing of all volumes with visible matter. Cells are wider where
    the grid would have more than `max_cells` along an axis.
    """
    seen = [layer for layer in layers if layer.is_visible]
    if not seen:  # one cell, in which there is nothing
        volume = layers[0].volume
        return volume.centre - 1.5 * volume.finest_spacing, volume.finest_spacing, (3, 3, 3)
    corners = np.concatenate([_corners(layer.volume) if layer.reach is None else layer.reach for layer in seen])
    low, high = corners.min(axis=0), corners.max(axis=0)
    finest = min(layer.volume.finest_spacing for layer in seen)
    cell = _width(max(cell_voxels * finest, float((high - low).max()) / (max_cells - 2)), finest)
    first = _corners(seen[0].volume).min(axis=0)
    while True:
        # A cell that would be filled by less than a thousandth of its width is rounding, or is not seen.
        starts = np.floor((low - first) / cell + 1e-3)
        nums = np.maximum(1, np.ceil((high - first) / cell - 1e-3) - starts)
        if nums.max() <= max_cells - 2:
            break
        cell = _width(cell * (1 + 1 / (2 * _WIDTHS_PER_OCTAVE)), finest)
    x, y, z = (int(num) + 2 for num in nums)
    return first + (starts - 1) * cell, cell, (x, y, z)


def _width(least: float, finest: float) -> float:
    """Return the smallest width of cells that is at least `least`. finest: the finest spacing."""
    step = 2.0 ** np.floor(np.log2(least / finest)) * finest / _WIDTHS_PER_OCTAVE
    return float(np.ceil(least / step * (1 - 1e-9)) * step)


def _corners(volume: Volume) -> Float64:
    """Return the corners of the box of a volume in the world, float64 [8, 3]."""
    ends = np.array([[-0.5] * 3, np.array(volume.shape_xyz) - 0.5])
    chosen = np.array([[ends[(k >> axis) & 1, axis] for axis in range(3)] for k in range(8)])
    return np.asarray(chosen @ volume.world_from_index[:3, :3].T + volume.world_from_index[:3, 3])


def average_layers(
    layers: Sequence[Matter], origin: Float64, cell: float, shape_xyz: tuple[int, int, int], threads: ThreadPool
) -> MatterGrid:
    """Return the matter of all layers on a grid. origin, cell, shape_xyz: as `place_grid` returns them.

    Raises InputError if a volume's file was changed.
    """
    x, y, z = shape_xyz
    matter = MatterGrid(origin, cell, shape_xyz, np.zeros((4, z, y, -(-x // ROW_CELLS) * ROW_CELLS), np.float32))
    for layer in filter(lambda each: each.is_visible, layers):
        if layer.are_removed is None:
            _add_layer(layer, matter, threads)
            continue
        own = matter._replace(cells=np.zeros_like(matter.cells))
        _add_layer(layer, own, threads)
        matter.cells[:] += own.cells * _kept_shares(layer.volume, layer.are_removed, matter)
    return matter


def _add_layer(layer: Matter, matter: MatterGrid, threads: ThreadPool) -> None:
    volume, cell = layer.volume, matter.cell
    to_index = np.linalg.inv(volume.world_from_index)
    places = np.column_stack([to_index[:3, :3] * cell, to_index[:3, :3] @ matter.origin + to_index[:3, 3]])
    num_places = round(_PLACES_PER_VOXEL * cell / volume.finest_spacing)
    average = kernels().average_matter.partial(
        raw=raw_voxels(volume), scalars=_scalars_of_patterns(volume.values.dtype), shown=volume.are_shown,
        is_labels=volume.is_labels, curve=layer.transfer.curve(cell * layer.weight),
        breakpoints=visibility_breakpoints(layer.transfer, cell * layer.weight), index_from_cells=places.ravel(),
        num_places=min(max(num_places, 1), _MAX_PLACES), out=matter.cells,
    )  # fmt: skip
    volume.require_unchanged()
    threads.map(lambda z: average(slab=z), range(matter.cells.shape[1]))
    volume.require_unchanged()


def _scalars_of_patterns(dtype: np.dtype[np.generic]) -> Array | None:
    """Return the scalar of each bit pattern, NaN for numbers that are not finite; None for more than 16 bits."""
    if dtype.itemsize > 2:
        return None
    patterns = np.arange(1 << 8 * dtype.itemsize, dtype=f"u{dtype.itemsize}").view(dtype)
    scalars = patterns.astype(np.float64)
    scalars[~np.isfinite(scalars)] = np.nan
    return scalars


def _kept_shares(volume: Volume, are_removed: Callable[[Float64], Bools], matter: MatterGrid) -> Float32:
    """Return the share of each cell that is not clipped away, float32 [z, y, x], padded.

    Cells beside which nothing changes, by the middles of cells, are kept or removed as a whole.
    """
    to_index = np.linalg.inv(volume.world_from_index)

    def are_kept(cells: Float64) -> Bools:
        places = matter.origin + matter.cell * cells
        indices = places @ to_index[:3, :3].T + to_index[:3, 3] - volume.centre_index
        return ~are_removed(np.stack([indices, indices], axis=1))

    shape = matter.cells.shape[1:]
    shares = are_kept(np.indices(shape).reshape(3, -1).T[:, ::-1] + 0.5).reshape(shape).astype(np.float32)
    cut = _beside_changes(shares > 0)
    corners = np.argwhere(cut)[:, ::-1]
    places = np.array(list(itertools.product((np.arange(_CLIP_PLACES) + 0.5) / _CLIP_PLACES, repeat=3)))
    shares[cut] = np.mean([are_kept(corners + place) for place in places], axis=0)
    return shares


def _beside_changes(flags: Bools) -> Bools:
    """Return which cells differ from one of the 26 cells around them, bool [z, y, x]."""
    every, some = flags, flags
    for axis in range(3):
        padded = [np.pad(np.moveaxis(each, axis, 0), [(1, 1), (0, 0), (0, 0)], mode="edge") for each in (every, some)]
        every, some = padded[0][:-2] & padded[0][1:-1] & padded[0][2:], padded[1][:-2] | padded[1][1:-1] | padded[1][2:]
        every, some = np.moveaxis(every, 0, axis), np.moveaxis(some, 0, axis)
    return some & ~every


def coarser(matter: MatterGrid) -> MatterGrid:
    """Return the same matter on cells of twice the width."""
    x, y, z = matter.shape_xyz
    halves = (-(-x // 2), -(-y // 2), -(-z // 2))
    padded = np.zeros((4, 2 * halves[2], 2 * halves[1], 2 * halves[0]), np.float32)
    padded[:, :z, :y, :x] = matter.cells[..., :x]
    sums = padded[..., ::2] + padded[..., 1::2]
    sums = sums[:, :, ::2] + sums[:, :, 1::2]
    sums = sums[:, ::2] + sums[:, 1::2]
    cells = np.zeros((4, halves[2], halves[1], -(-halves[0] // ROW_CELLS) * ROW_CELLS), np.float32)
    cells[..., : halves[0]] = sums / 4  # the mean of eight depths, on a path of twice the length
    return MatterGrid(matter.origin, 2 * matter.cell, halves, cells)
