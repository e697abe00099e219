"""Measure how long rays are inside what is left of the volume's box."""

from __future__ import annotations

import math

import numpy as np

from renderer.compiled import jit
from renderer.view import RaySetup, View, ray_setup
from renderer.volume import Float32, Float64, Volume


def chord_lengths(volume: Volume, view: View) -> Float32:
    """Return the world length of each pixel's ray inside the box, beyond the near plane and less cuts, float32 [h, w]."""
    width, height = view.size
    lengths = np.empty((height, width), np.float32)
    unit = volume.half_diagonal
    _measure_chords(ray_setup(volume, unit, view), np.array(volume.shape_xyz) / 2.0, unit, lengths)
    return lengths


@jit
def _measure_chords(rays: RaySetup, half_shape: Float64, unit: float, lengths: Float32) -> None:
    """Write the lengths [h, w]. half_shape: float64 [3], of the box, in voxels. unit: world length of a model unit."""
    origin, direction, cuts = np.empty(3), np.empty(3), rays.cuts
    volume = np.column_stack((np.eye(3), -half_shape, half_shape))
    removed = np.empty((0 if cuts is None else len(cuts.boxes), 2))
    for row in range(lengths.shape[0]):
        y = row + 0.5 - rays.center_px[1]
        for column in range(lengths.shape[1]):
            x = column + 0.5 - rays.center_px[0]
            for axis in range(3):
                origin[axis] = rays.origins[axis, 0] + rays.origins[axis, 1] * x + rays.origins[axis, 2] * y
                direction[axis] = rays.directions[axis, 0] + rays.directions[axis, 1] * x + rays.directions[axis, 2] * y
            start, end = _clip_to_slabs(volume, origin, direction, rays.start, math.inf)
            if cuts is not None:
                start, end = _clip_to_slabs(cuts.slabs, origin, direction, start, end)
                for k in range(len(removed)):
                    removed[k] = _clip_to_slabs(cuts.boxes[k], origin, direction, start, end)
            per_depth = math.sqrt(1.0 + rays.slope_per_px * rays.slope_per_px * (x * x + y * y))
            lengths[row, column] = _length_without(removed, start, end) * per_depth * unit


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
def _length_without(removed: Float64, start: float, end: float) -> float:
    """Return the length from start to end that is in no removed range, float64 [n, 2]."""
    length = 0.0
    while start < end:
        until = end
        for k in range(len(removed)):
            if removed[k, 0] < removed[k, 1] and start < removed[k, 1]:
                until = min(until, max(removed[k, 0], start))
        length += until - start
        start = until
        for _ in range(len(removed)):
            for k in range(len(removed)):
                if removed[k, 0] <= start < removed[k, 1]:
                    start = removed[k, 1]
    return length
