"""The light grid: which share of the ambient and of the diffuse light reaches each place of the object.

Occlusion is twice the mean over all directions of exp(-D), at most 1. D is the optical depth from START_CELLS cells
away to the radius. An opaque plane hides one half of all directions, so that its surface has the factor 1, as an open
place has; corners and what is buried are darker. The shadow is the mean of exp(-D) over the directions to a round light
of the angular radius LIGHT_RADIUS, to the volume's border. All rays leave out the first START_CELLS cells: with them,
surfaces would shade themselves.

Rays are sampled in one grid of mean extinctions, where steps grow with the distance. Coarser grids for the far part
were faster, but made everything darker: the mean of a thin wall and of the opening beside it lets less light through
than the two by themselves.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from renderer.kernels import LightGrid, ThreadPool, kernels
from renderer.scene import ShadingSpec, Vector
from renderer.transfer import TransferFunction, make_classifier, make_light_grid, raw_voxels
from renderer.volume import Bools, Float32, Float64, Volume

# Along the longest axis, at most.
MAX_CELLS = 128
# Of the volume's diagonal.
OCCLUSION_RADIUS = 0.1
# Degrees. With a smaller light, shadows have edges that are sharper than cells.
LIGHT_RADIUS = 14.0
# The first part of a ray, which is left out, in the smallest widths of cells.
START_CELLS = 2

# What docs/benchmarks/occlusion.md says suffices.
_NUM_OCCLUSION_RAYS, _OCCLUSION_GROWTH = 24, 0.35
_NUM_LIGHT_RAYS, _LIGHT_GROWTH = 14, 0.07
# As in the kernel `transmit`.
_CELLS_OF_PART = 16
_GOLDEN_ANGLE = np.pi * (1 + 5**0.5)


def compute_light_grid(
    volume: Volume,
    transfer: TransferFunction,
    shading: ShadingSpec,
    *,
    are_removed: Callable[[Float64], Bools] | None = None,
    max_cells: int = MAX_CELLS,
    num_threads: int = 1,
) -> LightGrid:
    """Return the light grid that a shading asks for, which does not depend on the number of threads.

    are_removed: which boxes, float64 [n, 2, 3] of lowest and highest corners in index space relative to the volume's
        centre, let all light through, though the volume does not. max_cells: along the longest axis. Raises InputError
        where the volume's file was changed.
    """
    level = max(0, (-(-max(volume.shape_xyz) // max_cells) - 1).bit_length())
    width = volume.finest_spacing * 2**level
    start = START_CELLS * width
    radius = shading.occlusion_radius
    radius = max(OCCLUSION_RADIUS * 2 * volume.half_diagonal if radius is None else radius, start + width)
    across = float(volume.spacing @ volume.shape_xyz)  # at least as long as any way through it
    occlusions = shadows = None
    with ThreadPool(num_threads) as threads:
        depths = _mean_depths(volume, transfer, level, threads)
        if are_removed is not None:
            _remove(depths, volume, level, are_removed)
        if shading.occlusion > 0:
            ends = _sample_ends(start, radius, width, _OCCLUSION_GROWTH)
            mean = _transmission(volume, depths, level, _sphere(_NUM_OCCLUSION_RAYS), ends, threads)
            occlusions = np.minimum(2 * mean, np.float32(1))
        if shading.shadow > 0 and shading.light != "camera":
            ends = _sample_ends(start, start + across, width, _LIGHT_GROWTH)
            shadows = _transmission(volume, depths, level, _cone(shading.light, _NUM_LIGHT_RAYS), ends, threads)
    return make_light_grid(occlusions, shadows, float(1 << level), (float(shading.occlusion), float(shading.shadow)))


def _mean_depths(volume: Volume, transfer: TransferFunction, level: int, threads: ThreadPool) -> Float32:
    """Return the mean optical depths of a finest spacing, of cells of 2^level voxels, as `transmit` takes them."""
    classifier, raw = make_classifier(volume, transfer, None, opacity=False), raw_voxels(volume)
    by_pattern = None if classifier.table is None else np.ascontiguousarray(classifier.table[:, 3])
    out, shares = np.empty((2, *(-(-num >> level) for num in raw.shape)), np.float32)
    average = kernels().average_voxels.partial(raw=raw, by_pattern=by_pattern, curve=classifier.curve, level=level)
    volume.require_unchanged()
    threads.map(lambda z: average(slab=z, out=out[z]), range(len(out)))
    volume.require_unchanged()
    if volume.are_shown is not None:
        themselves = np.arange(256, dtype=np.float32)
        share = kernels().average_voxels.partial(raw=volume.are_shown, by_pattern=themselves, curve=None, level=level)
        threads.map(lambda z: share(slab=z, out=shares[z]), range(len(out)))
        out *= shares
    return np.pad(out, 1, mode="edge")


def _remove(depths: Float32, volume: Volume, level: int, are_removed: Callable[[Float64], Bools]) -> None:
    """Let light through the cells whose middles are removed. depths: with a border; updated."""
    z, y, x = ((np.arange(-1, num - 1) + 0.5) * 2**level - 0.5 for num in depths.shape)
    for plane, at in zip(depths, z, strict=True):
        row, column = np.nonzero(plane)
        middles = np.column_stack([x[column], y[row], np.full(len(row), at)]) - volume.centre_index
        plane[row, column] *= ~are_removed(np.stack([middles, middles], axis=1))


def _transmission(
    volume: Volume, depths: Float32, level: int, directions: Float64, ends: Float64, threads: ThreadPool
) -> Float32:
    """Return the mean transmission of rays from the centre of each cell, as in a LightGrid.

    directions: [n, 3], unit vectors in world axes. ends: [m + 1], where samples of a ray end, world lengths.
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
    """Return in which parts of rows of cells anything is visible, or beside them: `filled` of the kernel `transmit`."""
    filled = np.logical_or.reduceat(depths > 0, np.arange(0, depths.shape[2], _CELLS_OF_PART), axis=2)
    for axis in range(3):
        along = np.moveaxis(filled, axis, 0)
        along[:-1] |= along[1:]
    return np.asarray(filled)


def _sample_ends(start: float, end: float, width: float, growth: float) -> Float64:
    """Return where samples end: each is a cell long, or a share of its distance where that is longer."""
    ends = [start]
    while ends[-1] < end:
        ends.append(min(end, ends[-1] + max(width, growth * ends[-1])))
    return np.array(ends)


def _sphere(num: int) -> Float64:
    """Return directions that are spread evenly, on a spiral, float64 [num, 3]."""
    turns = np.arange(num) + 0.5
    z = 1 - 2 * turns / num
    across = np.sqrt(1 - z * z)
    return np.column_stack([across * np.cos(_GOLDEN_ANGLE * turns), across * np.sin(_GOLDEN_ANGLE * turns), z])


def _cone(light: Vector, num: int) -> Float64:
    """Return directions to points that are spread evenly, on a spiral, over a round light, float64 [num, 3]."""
    toward = np.array(light, np.float64) / np.abs(light).max()
    toward /= np.linalg.norm(toward)
    side = np.cross(toward, np.eye(3)[np.abs(toward).argmin()])
    side /= np.linalg.norm(side)
    turns = np.arange(num)[:, None] + 0.5
    across = np.cos(_GOLDEN_ANGLE * turns) * side + np.sin(_GOLDEN_ANGLE * turns) * np.cross(toward, side)
    directions = toward + np.tan(np.radians(LIGHT_RADIUS)) * np.sqrt(turns / num) * across
    return np.asarray(directions / np.linalg.norm(directions, axis=1, keepdims=True))
