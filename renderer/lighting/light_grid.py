"""Compute the light grid: the shares of the ambient and of the diffuse light that reach each position in the object.

The factor of occlusion is twice the mean over all directions of exp(-D), at most 1, with D the optical depth along a
ray up to the radius of occlusion. An opaque plane hides half of all directions. Its surface has the factor 1, as a
position in the open has; corners and buried positions are darker. The factor of shadow is the mean of exp(-D) over the
directions to a round light of the angular radius LIGHT_RADIUS, with rays up to the volume's border. All rays leave out
the first START_CELLS cells, in which surfaces would shade themselves.

Rays are sampled in one grid of mean extinctions, with steps that grow with the distance. Coarser grids for the far
parts of rays are faster, but make everything darker: the mean of a thin wall and of the opening beside it lets less
light through than wall and opening by themselves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from renderer.cache import NOT_KEPT, KeptArrays
from renderer.kernels import LightGrid, ThreadPool, kernels
from renderer.scene import ShadingSpec, Vector
from renderer.transfer import TransferFunction, make_classifier, make_light_grid, raw_voxels
from renderer.volume import Bools, Float32, Float64, Volume

# The largest number of cells of the light grid along its longest axis.
MAX_CELLS = 128
# The distance up to which matter dims the ambient light of a point, unless a scene gives one, as a share of the
# volume's diagonal.
OCCLUSION_RADIUS = 0.1
# The angular radius of the light that casts shadows, in degrees. The shadows of a smaller light would have edges
# sharper than the cells of the light grid.
LIGHT_RADIUS = 14.0
# The length that a ray leaves out at its start, in widths of a cell along the axis of finest spacing.
START_CELLS = 2

# The number of rays from each cell, in all directions, that measure its occlusion. It suffices by the measurements in
# docs/benchmarks/occlusion.md.
_NUM_OCCLUSION_RAYS = 24
# The length of a sample of a ray for occlusion, as a share of the sample's distance from the ray's start. It suffices
# by the measurements in docs/benchmarks/occlusion.md.
_OCCLUSION_GROWTH = 0.35
# The number of rays from each cell to the light that measure its shadow. It suffices by the measurements in
# docs/benchmarks/occlusion.md.
_NUM_LIGHT_RAYS = 14
# The length of a sample of a ray to the light, as a share of the sample's distance from the ray's start. It suffices by
# the measurements in docs/benchmarks/occlusion.md.
_LIGHT_GROWTH = 0.07
# The number of cells in a part of a row of the grid. The kernel `transmit`, which has the same number, skips parts in
# which nothing is visible.
_CELLS_OF_PART = 16
# The turn between neighbouring points of a spiral, in radians. With this angle, points are spread evenly.
_GOLDEN_ANGLE = np.pi * (1 + 5**0.5)


def compute_light_grid(
    volume: Volume,
    transfer: TransferFunction,
    shading: ShadingSpec,
    *,
    are_removed: Callable[[Float64], Bools] | None = None,
    max_cells: int = MAX_CELLS,
    num_threads: int = 1,
    kept: KeptArrays = NOT_KEPT,
    ranges: Float64 | None = None,
) -> LightGrid:
    """Return the light grid for a shading. The result does not depend on the number of threads.

    are_removed: tells which boxes are clipped away and let all light through. Boxes are float64 [n, 2, 3], the lowest
        and highest corners in index space relative to the volume's centre.
    max_cells: the largest number of cells along the longest axis of the grid.
    kept: the entry in which the same factors were kept, or are kept now.
    ranges: the ranges of scalars in bricks, as in `build_pyramid`.

    Raises InputError if the volume's file was changed.
    """
    level = max(0, (-(-max(volume.shape_xyz) // max_cells) - 1).bit_length())
    with kept.making() as found:
        factors = found
        if factors is None:
            with ThreadPool(num_threads) as threads:
                depths = _mean_depths(volume, transfer, level, ranges, threads)
                if are_removed is not None:
                    _remove(depths, volume, level, are_removed)
                factors = _factors(volume, depths, shading, level, threads)
            kept.keep(factors)
    strengths = float(shading.occlusion), float(shading.shadow)
    return make_light_grid(factors.get("occlusion"), factors.get("shadow"), float(1 << level), strengths)


def _factors(
    volume: Volume, depths: Float32, shading: ShadingSpec, level: int, threads: ThreadPool
) -> dict[str, Float32]:
    """Return the factors that the shading asks for, `occlusion` and `shadow`, as `make_light_grid` takes them.

    depths: as `_mean_depths` returns them. level: the octree level of the cells of the grid.
    """
    width = volume.finest_spacing * 2**level
    start = START_CELLS * width
    radius = shading.occlusion_radius
    radius = max(OCCLUSION_RADIUS * 2 * volume.half_diagonal if radius is None else radius, start + width)
    across = float(volume.spacing @ volume.shape_xyz)  # at least the length of any ray through the volume
    factors = dict[str, Float32]()
    if shading.occlusion > 0:
        ends = _sample_ends(start, radius, width, _OCCLUSION_GROWTH)
        mean = _transmission(volume, depths, level, _sphere(_NUM_OCCLUSION_RAYS), ends, threads)
        factors["occlusion"] = np.minimum(2 * mean, np.float32(1))
    if shading.shadow > 0 and shading.light != "camera":
        ends = _sample_ends(start, start + across, width, _LIGHT_GROWTH)
        directions = _cone(shading.light, _NUM_LIGHT_RAYS)
        factors["shadow"] = _transmission(volume, depths, level, directions, ends, threads)
    return factors


def _mean_depths(
    volume: Volume, transfer: TransferFunction, level: int, ranges: Float64 | None, threads: ThreadPool
) -> Float32:
    """Return the mean optical depths of cells of 2^level voxels a side, on a path as long as the finest spacing.

    Returns float32 [z + 2, y + 2, x + 2]: the outermost cells are repeated once beyond each border.
    """
    classifier, raw = make_classifier(volume, transfer, None, opacity=False), raw_voxels(volume)
    by_pattern = None if classifier.table is None else np.ascontiguousarray(classifier.table[:, 3])
    out, shares = np.empty((2, *(-(-num >> level) for num in raw.shape)), np.float32)
    average = kernels().average_voxels.partial(
        raw=raw, by_pattern=by_pattern, curve=classifier.curve, ranges=ranges, breakpoints=classifier.breakpoints,
        level=level,
    )  # fmt: skip
    volume.require_unchanged()
    threads.map(lambda z: average(slab=z, out=out[z]), range(len(out)))
    volume.require_unchanged()
    if volume.are_shown is not None:
        themselves = np.arange(256, dtype=np.float32)
        share = kernels().average_voxels.partial(
            raw=volume.are_shown, by_pattern=themselves, curve=None, ranges=None, breakpoints=np.empty(0), level=level
        )
        threads.map(lambda z: share(slab=z, out=shares[z]), range(len(out)))
        out *= shares
    return np.pad(out, 1, mode="edge")


def _remove(depths: Float32, volume: Volume, level: int, are_removed: Callable[[Float64], Bools]) -> None:
    """Set the depths of cells whose middles are clipped away to 0, in place. depths: as `_mean_depths` returns them."""
    z, y, x = ((np.arange(-1, num - 1) + 0.5) * 2**level - 0.5 for num in depths.shape)
    for plane, at in zip(depths, z, strict=True):
        row, column = np.nonzero(plane)
        middles = np.column_stack([x[column], y[row], np.full(len(row), at)]) - volume.centre_index
        plane[row, column] *= ~are_removed(np.stack([middles, middles], axis=1))


def _transmission(
    volume: Volume, depths: Float32, level: int, directions: Float64, ends: Float64, threads: ThreadPool
) -> Float32:
    """Return the mean transmission of rays from the centre of each cell, with the outermost cells repeated.

    Returns float32 [z + 2, y + 2, x + 2], as in a LightGrid.

    directions: [n, 3], unit vectors in world axes. ends: [m + 1], the ends of samples along a ray, as world lengths
        from the cell; the first entry is the start of the first sample.
    """
    cells_from_world = np.linalg.inv(volume.world_from_index[:3, :3]) / 2**level
    middles = (ends[1:] + ends[:-1]) / 2
    offsets = ((directions @ cells_from_world.T)[:, None] * middles[:, None]).astype(np.float32)
    lengths = (np.diff(ends) / volume.finest_spacing).astype(np.float32)
    border = (np.array(volume.shape_xyz) / 2**level + 0.5).astype(np.float32)
    out = np.empty([num - 2 for num in depths.shape], np.float32)
    filled = _filled_parts(depths)
    transmit = kernels().transmit.partial(depths=depths, filled=filled, end=border, offsets=offsets, lengths=lengths)
    threads.map(lambda z: transmit(slab=z, out=out[z]), range(len(out)))
    return np.pad(out, 1, mode="edge")


def _filled_parts(depths: Float32) -> Bools:
    """Return `filled` of the kernel `transmit`: which parts of rows of cells show anything, or lie before such parts.

    depths: as `_mean_depths` returns them.
    """
    filled = np.logical_or.reduceat(depths > 0, np.arange(0, depths.shape[2], _CELLS_OF_PART), axis=2)
    for axis in range(3):
        along = np.moveaxis(filled, axis, 0)
        along[:-1] |= along[1:]
    return np.asarray(filled)


def _sample_ends(start: float, end: float, width: float, growth: float) -> Float64:
    """Return the ends of samples along a ray, as world lengths from its start.

    A sample is as long as a cell, or as `growth` times its distance from the ray's start if that is longer.

    start, end: the distances at which the first sample starts and the last one ends. width: the width of a cell.
    """
    ends = [start]
    while ends[-1] < end:
        ends.append(min(end, ends[-1] + max(width, growth * ends[-1])))
    return np.array(ends)


def _sphere(num: int) -> Float64:
    """Return directions that are spread evenly over the sphere, on a spiral: float64 [num, 3]."""
    turns = np.arange(num) + 0.5
    z = 1 - 2 * turns / num
    across = np.sqrt(1 - z * z)
    return np.column_stack([across * np.cos(_GOLDEN_ANGLE * turns), across * np.sin(_GOLDEN_ANGLE * turns), z])


def _cone(light: Vector, num: int) -> Float64:
    """Return directions to points that are spread evenly over a round light, on a spiral: float64 [num, 3]."""
    toward = np.array(light, np.float64) / np.abs(light).max()
    toward /= np.linalg.norm(toward)
    side = np.cross(toward, np.eye(3)[np.abs(toward).argmin()])
    side /= np.linalg.norm(side)
    turns = np.arange(num)[:, None] + 0.5
    across = np.cos(_GOLDEN_ANGLE * turns) * side + np.sin(_GOLDEN_ANGLE * turns) * np.cross(toward, side)
    directions = toward + np.tan(np.radians(LIGHT_RADIUS)) * np.sqrt(turns / num) * across
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))
