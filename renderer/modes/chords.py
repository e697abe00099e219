"""Measure how long rays are inside the volume's box."""

from __future__ import annotations

import math

import numpy as np

from renderer.compiled import jit
from renderer.view import RaySetup, View, ray_setup
from renderer.volume import Float32, Float64, Volume


def chord_lengths(volume: Volume, view: View) -> Float32:
    """Return the world length of each pixel's ray inside the volume's box, beyond the near plane, float32 [h, w]."""
    width, height = view.size
    lengths = np.empty((height, width), np.float32)
    unit = volume.half_diagonal
    _measure_chords(ray_setup(volume, unit, view), np.array(volume.shape_xyz) / 2.0, unit, lengths)
    return lengths


@jit
def _measure_chords(rays: RaySetup, half_shape: Float64, unit: float, lengths: Float32) -> None:
    """Write the lengths [h, w]. half_shape: float64 [3], of the box, in voxels. unit: world length of a model unit."""
    for row in range(lengths.shape[0]):
        y = row + 0.5 - rays.center_px[1]
        for column in range(lengths.shape[1]):
            x = column + 0.5 - rays.center_px[0]
            start, end = rays.start, math.inf
            for axis in range(3):
                origin = rays.origins[axis, 0] + rays.origins[axis, 1] * x + rays.origins[axis, 2] * y
                speed = rays.directions[axis, 0] + rays.directions[axis, 1] * x + rays.directions[axis, 2] * y
                if speed == 0.0:
                    if not -half_shape[axis] <= origin < half_shape[axis]:
                        end = -math.inf
                    continue
                one, other = (-half_shape[axis] - origin) / speed, (half_shape[axis] - origin) / speed
                start, end = max(start, min(one, other)), min(end, max(one, other))
            per_depth = math.sqrt(1.0 + rays.slope_per_px * rays.slope_per_px * (x * x + y * y))
            lengths[row, column] = max(end - start, 0.0) * per_depth * unit if end > start else 0.0
