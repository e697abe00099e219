"""Measure how long rays are inside what is left of the volume's box."""

from __future__ import annotations

import math

import numpy as np

from renderer.compiled import ThreadPool, jit
from renderer.view import RaySetup, View, ray_setup
from renderer.volume import Bools, Float32, Float64, Volume

_MIN_PIXELS_PER_THREAD = 1 << 15


def chord_lengths(volume: Volume, view: View, threads: ThreadPool) -> Float32:
    """Return the world length of each pixel's ray inside the box, beyond the near plane, less cuts: float32 [h, w].

    Voxels without data do not count.
    """
    width, height = view.size
    lengths = np.empty((height, width), np.float32)
    rays, half_shape = ray_setup(volume, volume.half_diagonal, view), np.array(volume.shape_xyz) / 2.0
    kept, removed = np.column_stack([np.eye(3), -half_shape, half_shape]), np.empty((0, 3, 5))
    if rays.cuts is not None:
        kept, removed = np.concatenate([kept, rays.cuts.slabs]), rays.cuts.boxes
    rays = rays._replace(cuts=None)
    absent = volume.are_absent if volume.num_absent else None

    def work(first: int, end: int) -> None:
        _measure_chords(rays, kept, removed, absent, volume.half_diagonal, first, lengths[first:end])

    threads.for_ranges(work, *rows_per_thread(lengths))
    return lengths


def rows_per_thread(pixels: Float32) -> tuple[int, int]:
    """Return the number of rows of pixels [h, w], and how many of them are worth a thread."""
    height, width = pixels.shape
    return height, -(-_MIN_PIXELS_PER_THREAD // width)


@jit
def _measure_chords(
    rays: RaySetup, kept: Float64, removed: Float64, absent: Bools | None, unit: float, first_row: int, lengths: Float32
) -> None:
    """Write the lengths [h, w] inside `kept` slabs [k, 5] less `removed` boxes [m, 3, 5], both as in Cuts.

    absent: bool [z, y, x], which voxels do not count; None if all do. unit: world length of a model unit. first_row:
    the row of the image at which `lengths` begin.
    """
    origin, direction, ranges = np.empty(3), np.empty(3), np.empty((len(removed), 2))
    for row in range(lengths.shape[0]):
        y = first_row + row + 0.5 - rays.center_px[1]
        for column in range(lengths.shape[1]):
            x = column + 0.5 - rays.center_px[0]
            for axis in range(3):
                origin[axis] = rays.origins[axis, 0] + rays.origins[axis, 1] * x + rays.origins[axis, 2] * y
                direction[axis] = rays.directions[axis, 0] + rays.directions[axis, 1] * x + rays.directions[axis, 2] * y
            start, end = _clip_to_slabs(kept, origin, direction, rays.start, math.inf)
            for k in range(len(removed)):
                ranges[k] = _clip_to_slabs(removed[k], origin, direction, start, end)
            per_depth = math.sqrt(1.0 + rays.slope_per_px * rays.slope_per_px * (x * x + y * y))
            length = _length_without(ranges, absent, origin, direction, start, end)
            lengths[row, column] = length * per_depth * unit


@jit
def _clip_to_slabs(
    slabs: Float64, origin: Float64, direction: Float64, start: float, end: float
) -> tuple[float, float]:
    """Clip a ray to what slabs [k, 5], as in Cuts, have in common; nothing is left unless the first result is less."""
    for k in range(len(slabs)):
        height = slabs[k, 0] * origin[0] + slabs[k, 1] * origin[1] + slabs[k, 2] * origin[2]
        speed = slabs[k, 0] * direction[0] + slabs[k, 1] * direction[1] + slabs[k, 2] * direction[2]
        low, high = slabs[k, 3], slabs[k, 4]
        if speed == 0.0:
            if not low <= height < high:
                end = -math.inf
            continue
        one, other = (low - height) / speed, (high - height) / speed
        start, end = max(start, min(one, other)), min(end, max(one, other))
    return start, end


@jit
def _length_without(
    removed: Float64, absent: Bools | None, origin: Float64, direction: Float64, start: float, end: float
) -> float:
    """Return the length from start to end that is in no removed range, float64 [n, 2], and not in absent voxels."""
    length = 0.0
    while start < end:
        until = end
        for k in range(len(removed)):
            if removed[k, 0] < removed[k, 1] and start < removed[k, 1]:
                until = min(until, max(removed[k, 0], start))
        length += until - start if absent is None else _length_of_data(absent, origin, direction, start, until)
        start = until
        for _ in range(len(removed)):
            for k in range(len(removed)):
                if removed[k, 0] <= start < removed[k, 1]:
                    start = removed[k, 1]
    return length


@jit
def _length_of_data(absent: Bools, origin: Float64, direction: Float64, start: float, end: float) -> float:
    """Return the length from start to end, inside of the box, in voxels with data, from one voxel to the next.

    origin: in voxels from the middle of the volume.
    """
    corner, voxel = np.empty(3), np.empty(3, np.int64)
    for axis in range(3):
        num = absent.shape[2 - axis]
        corner[axis] = origin[axis] + num / 2.0
        voxel[axis] = min(max(math.floor(corner[axis] + start * direction[axis]), 0), num - 1)
    length = 0.0
    while True:
        leave, across = end, -1
        for axis in range(3):
            if direction[axis] != 0.0:
                at = (voxel[axis] + int(direction[axis] > 0.0) - corner[axis]) / direction[axis]
                if at < leave:
                    leave, across = at, axis
        leave = max(leave, start)
        if not absent[voxel[2], voxel[1], voxel[0]]:
            length += leave - start
        start = leave
        if across < 0:
            return length
        voxel[across] += 1 if direction[across] > 0.0 else -1
        if not 0 <= voxel[across] < absent.shape[2 - across]:
            return length
