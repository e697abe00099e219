"""What bricks are made of, in plain numpy over whole volumes: means and errors of all cells of a level, and fields."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.classify import FAINTEST
from renderer.transfer import TransferFunction
from renderer.volume import Volume

Array = npt.NDArray[Any]
Float64 = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Shape = tuple[int, int, int]

OBLIQUE = np.array([[0.5, 0.2, -0.1, 3.0], [0.1, -0.9, 0.3, -2.0], [0.0, 0.4, 2.0, 7.0], [0.0, 0.0, 0.0, 1.0]])


def patches(shape: Shape, seed: int, side: int = 6) -> Float64:
    """[z, y, x] in [0, 1]: noise in some blocks, and 0 around them."""
    rng = np.random.default_rng(seed)
    is_block = rng.random([-(-n // side) for n in shape]) < 0.2
    inside = np.kron(is_block, np.ones((side,) * 3, bool))[: shape[0], : shape[1], : shape[2]]
    return np.asarray(np.where(inside, rng.random(shape), 0.0))


def random_transfer(rng: np.random.Generator, low: float, high: float) -> TransferFunction:
    """Some slopes, steps and thin peaks between two scalars, most of them of no extinction."""
    shares = np.sort(rng.choice(np.arange(11) / 10, 6))  # steps, where one is drawn twice
    peak = rng.random() + np.array([-1e-3, 0, 1e-3])
    extinctions = np.concatenate([rng.choice([0.0, 0.0, 1.0], 6), [0.0, 1.0, 0.0]])
    order = np.argsort(np.concatenate([shares, peak]), kind="stable")
    values = low * (1 - np.clip(np.concatenate([shares, peak])[order], 0, 1))
    values = np.sort(values + high * np.clip(np.concatenate([shares, peak])[order], 0, 1))
    return TransferFunction(values, rng.random((9, 3)), extinctions[order], 1.0)


def depths_of(volume: Volume, transfer: TransferFunction) -> Float64:
    """[z, y, x, 4]: (tau c, tau) times the finest spacing."""
    colors, extinctions = transfer.classify(volume.values)
    depths = extinctions[..., None] * volume.finest_spacing
    depths[depths < FAINTEST] = 0.0
    return np.concatenate([colors * depths, depths], axis=-1)


def sums_over_cells(values: Array, level: int) -> Float64:
    """[z, y, x, ...] summed over the cells of a level, which the border may cut."""
    for axis in range(3):
        values = np.add.reduceat(values, np.arange(0, values.shape[axis], 1 << level), axis)
    return np.asarray(values, np.float64)


def means_over_cells(values: Array, level: int) -> Float64:
    """[z, y, x, c] over the cells of a level."""
    return np.asarray(sums_over_cells(values, level) / sums_over_cells(np.ones(values.shape[:3]), level)[..., None])


def errors_of_cells(volume: Volume, values: Float64, level: int) -> Float64:
    """[z, y, x]: root of the summed variance of values [z, y, x, c], times the cube root of the cell's volume in units
    of the finest spacing."""
    means = means_over_cells(values, level)
    for axis in range(3):
        means = np.repeat(means, 1 << level, axis).take(range(values.shape[axis]), axis)
    num_voxels = sums_over_cells(np.ones(values.shape[:3]), level)
    variance = sums_over_cells(np.sum((values - means) ** 2, axis=-1), level) / num_voxels
    return np.asarray(np.sqrt(variance) * np.cbrt(num_voxels * volume.voxel_volume) / volume.finest_spacing)


def per_brick(values: Array, side: int, apron: int = 0) -> dict[tuple[int, int, int], Array]:
    """By brick (x, y, z), the part of an array [z, y, x, ...] that lies in it, or in its apron."""

    def reach(k: int) -> slice:
        return slice(max(k * side - apron, 0), (k + 1) * side + apron)

    grid = np.ndindex(*(-(-n // side) for n in values.shape[:3]))
    return {(x, y, z): values[reach(z), reach(y), reach(x)] for z, y, x in grid}


def dual_cells_shown(volume: Volume, transfer: TransferFunction) -> Bools:
    """[z + 1, y + 1, x + 1]: whether any scalar between the smallest and largest corner of a dual cell is visible; cell
    (k, j, i) lies between the voxels before and at (k, j, i), or the nearest ones."""
    scalars = np.pad(volume.values.astype(np.float64), 1, mode="edge")
    low = high = scalars
    for axis in range(3):
        low, high = (
            pick(part.take(range(part.shape[axis] - 1), axis), part.take(range(1, part.shape[axis]), axis))
            for pick, part in ((np.minimum, low), (np.maximum, high))
        )

    def shows(s: Float64) -> Bools:
        return np.asarray(transfer.classify(s)[1] * volume.finest_spacing >= FAINTEST)

    shown = shows(low) | shows(high)
    ends = [-np.inf, *transfer.values, np.inf]
    for first, last in pairwise(ends):  # linear, so that its middle tells of all between
        start, end = np.maximum(low, first), np.minimum(high, last)
        shown |= (start < end) & shows(start / 2 + end / 2)
    return shown


def nodes_shown(cells: Bools) -> Bools:
    """The same of the cells of a level: [z + 1, y + 1, x + 1], whether any of the corners is visible."""
    shown = np.pad(cells, 1)
    for axis in range(3):
        shown = shown.take(range(shown.shape[axis] - 1), axis) | shown.take(range(1, shown.shape[axis]), axis)
    return np.asarray(shown)


def box_of(shown: Bools, brick: tuple[int, int, int], extent_zyx: Array) -> Float64:
    """[2, 3]: lowest and highest corner (x, y, z), in cells from the brick's own lowest one, around the dual cells that
    are shown in a brick of 16 cells a side; 0 where none is."""
    first = 16 * np.array(brick[::-1])
    z, y, x = (slice(start, start + 17) for start in first)
    inside = np.argwhere(shown[z, y, x])
    if len(inside) == 0:
        return np.zeros((2, 3))
    low = np.maximum(inside.min(axis=0) - 0.5, 0)
    high = np.minimum(inside.max(axis=0) + 0.5, np.minimum(extent_zyx - first, 16))
    return np.stack([low, high])[:, ::-1]
