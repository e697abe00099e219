"""Compute means and errors of all cells of a level, in plain numpy over whole volumes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from renderer.bricks import RAY_ERROR_FACTOR
from renderer.transfer import VISIBILITY_THRESHOLD, TransferFunction
from renderer.volume import Array, Float64, Volume

Shape = tuple[int, int, int]

OBLIQUE = np.array([[0.5, 0.2, -0.1, 3.0], [0.1, -0.9, 0.3, -2.0], [0.0, 0.4, 2.0, 7.0], [0.0, 0.0, 0.0, 1.0]])


def patches(shape: Shape, seed: int, side: int = 6) -> Float64:
    """Return noise in [0, 1] in some blocks of `side` voxels, and 0 around them, [z, y, x]."""
    rng = np.random.default_rng(seed)
    is_block = rng.random([-(-n // side) for n in shape]) < 0.2
    inside = np.kron(is_block, np.ones((side,) * 3, bool))[: shape[0], : shape[1], : shape[2]]
    return np.asarray(np.where(inside, rng.random(shape), 0.0))


def depths_of(volume: Volume, transfer: TransferFunction) -> Float64:
    """Return extinction times colour, and extinction (tau c, tau), of each voxel, times the finest spacing.

    Returns [z, y, x, 4].
    """
    colors, extinctions = transfer.classify(volume.values)
    depths = extinctions[..., None] * volume.finest_spacing
    depths[depths < VISIBILITY_THRESHOLD] = 0.0
    return np.concatenate([colors * depths, depths], axis=-1)


def sums_over_cells(values: Array, level: int) -> Float64:
    """Return the sums of voxels' values in each cell of a level, [z, y, x, ...]. The border may cut the last cells."""
    for axis in range(3):
        values = np.add.reduceat(values, np.arange(0, values.shape[axis], 1 << level), axis)
    return np.asarray(values, np.float64)


def means_over_cells(values: Array, level: int) -> Float64:
    """Return the means of voxels' values in each cell of a level, [z, y, x, c]."""
    return np.asarray(sums_over_cells(values, level) / sums_over_cells(np.ones(values.shape[:3]), level)[..., None])


def spread_of_cells(values: Float64, level: int) -> Float64:
    """Return the root of the variance, summed over channels, of voxels' values in each cell of a level, [z, y, x].

    values: [z, y, x, c]. It takes the differences from the means, which has no cancellation.
    """
    means = means_over_cells(values, level)
    for axis in range(3):
        means = np.repeat(means, 1 << level, axis).take(range(values.shape[axis]), axis)
    return np.asarray(np.sqrt(means_over_cells(((values - means) ** 2).sum(axis=-1, keepdims=True), level)[..., 0]))


def errors_of_cells(volume: Volume, values: Float64, level: int) -> Float64:
    """Return the error of each cell of a level, [z, y, x]: the spread of its voxels' values, times its side.

    values: [z, y, x, c]. The side is the cube root of the cell's volume, in units of the finest spacing.
    """
    num_voxels = sums_over_cells(np.ones(values.shape[:3]), level)
    sides = np.cbrt(num_voxels * volume.voxel_volume) / volume.finest_spacing
    return np.asarray(spread_of_cells(values, level) * sides)


def per_brick(values: Array, side: int, halo: int = 0) -> dict[tuple[int, int, int], Array]:
    """Return the part of an array [z, y, x, ...] that lies in each brick, or in its halo, by brick (x, y, z)."""

    def reach(k: int) -> slice:
        return slice(max(k * side - halo, 0), (k + 1) * side + halo)

    grid = np.ndindex(*(-(-n // side) for n in values.shape[:3]))
    return {(x, y, z): values[reach(z), reach(y), reach(x)] for z, y, x in grid}


def ranges_of_dual_cells(volume: Volume) -> tuple[Float64, Float64]:
    """Return the smallest and the largest of the eight voxels around each dual cell, [z + 1, y + 1, x + 1] each.

    Dual cell (k, j, i) lies between voxels (k - 1, j - 1, i - 1) and (k, j, i). Outside of the volume, the nearest
    voxel counts.
    """
    scalars = np.pad(volume.values.astype(np.float64), 1, mode="edge")
    low = high = scalars
    for axis in range(3):
        low, high = (
            pick(part.take(range(part.shape[axis] - 1), axis), part.take(range(1, part.shape[axis]), axis))
            for pick, part in ((np.minimum, low), (np.maximum, high))
        )
    return low, high


def channels_of(transfer: TransferFunction, finest_spacing: float) -> Float64:
    """Return (tau c, tau) times the finest spacing at the control points of a transfer function, [n, 4]."""
    depths = transfer.extinctions[:, None] * finest_spacing
    return np.concatenate([transfer.colors * depths, depths], axis=1)


def between_scalars(low: Float64, high: Float64, values: Float64, points: Float64) -> tuple[Float64, Float64, Float64]:
    """Return D^2, width^2 and J^2 between two scalars, as the kernel `subvoxel.cpp` defines them, [...] each.

    low, high: the scalars, [...] each. values: the control values, [n]. points: the channels at them, [n, c].
    D is integrated in each linear piece by Simpson's rule, which is exact there.
    """

    def linear(k: int, at: Float64) -> Float64:
        """Return the line through control points k - 1 and k at some scalars; constant beyond the outermost points."""
        first, last = max(k - 1, 0), min(k, len(values) - 1)
        width = values[last] - values[first]
        share = ((at - values[first]) / width if width > 0 else np.zeros_like(at))[..., None]
        return np.asarray(points[first] * (1 - share) + points[last] * share)

    def classified(at: Float64) -> Float64:
        number = np.searchsorted(values, at, side="right")
        return np.asarray(
            sum(np.where((number == k)[..., None], linear(k, at), 0.0) for k in range(len(values) + 1)), np.float64
        )

    first, last = classified(low), classified(high)
    extent = np.where(high > low, high - low, 1.0)
    squares, slopes = np.zeros(low.shape), np.zeros(low.shape)
    for k, (begin, end) in enumerate(pairwise([-np.inf, *values, np.inf])):
        start, stop = np.clip(low, begin, end), np.clip(high, begin, end)

        def off(at: Float64, k: int = k) -> Float64:
            share = ((at - low) / extent)[..., None]
            return np.asarray(linear(k, at) - first * (1 - share) - last * share)

        share = np.where(start < stop, (stop - start) / extent, 0.0)
        three = [(off(at) ** 2).sum(axis=-1) for at in (start, start / 2 + stop / 2, stop)]
        squares += share * (three[0] + 4 * three[1] + three[2]) / 6
        rise = ((off(stop) - off(start)) ** 2).sum(axis=-1)
        slopes += np.where(start < stop, rise / np.maximum(share, 1 / 16), 0.0)
    for value in np.unique(values):  # a step counts as a slope of the smallest width, 1 / 16
        jump = points[values == value][-1] - points[values == value][0]
        slopes += np.where((low < value) & (value <= high), 16 * (jump**2).sum(), 0.0)
    width = np.where(slopes > 0, 12 * squares / np.where(slopes > 0, slopes, 1.0), 1.0)
    jump = 0.35**2 * ((last - first) ** 2).sum(axis=-1)
    return squares, np.clip(width, 1 / 16**2, 1.0), jump


def dual_cells(brick: tuple[int, int, int], side: int) -> tuple[slice, slice, slice]:
    """Return the slices of an array of dual cells that meet a brick (x, y, z) of `side` voxels along each axis."""
    x, y, z = (slice(k * side, (k + 1) * side + 1) for k in brick)
    return z, y, x


def errors_of_bricks(volume: Volume, transfer: TransferFunction, level: int) -> dict[tuple[int, int, int], float]:
    """Return the error of each brick of a level above 0, by brick (x, y, z).

    It is the largest error of the nodes in the brick and its halo, of variation between voxels that no voxel shows, and
    of differences between neighbouring voxels, times RAY_ERROR_FACTOR.
    """
    nodes = per_brick(errors_of_cells(volume, depths_of(volume, transfer), level), 16, halo=1)
    distances, _, jumps = between_scalars(
        *ranges_of_dual_cells(volume), transfer.values, channels_of(transfer, volume.finest_spacing)
    )
    squares = np.maximum(distances, jumps)
    length = 2**level * np.cbrt(volume.voxel_volume) / volume.finest_spacing
    return {
        brick: RAY_ERROR_FACTOR * max(part.max(), length * np.sqrt(squares[dual_cells(brick, 16 << level)].max()))
        for brick, part in nodes.items()
    }
