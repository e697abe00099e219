"""Views along z of shapes that do not change along it, and the share of each pixel that a shape covers."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from renderer.view import View
from renderer.volume import Array, Float64, Volume


def turned(volume: Volume, degrees: float, voxels_per_px: float, size: tuple[int, int]) -> View:
    """Parallel rays along z, with the picture turned around its middle."""
    turn = math.radians(degrees)
    right, up = (math.cos(turn), math.sin(turn), 0.0), (-math.sin(turn), math.cos(turn), 0.0)
    axes = np.array([right, up, (0.0, 0.0, 1.0)])
    return View(axes, volume.centre, 100.0, "orthographic", 1 / voxels_per_px, size)


def coverage(view: View, is_inside: Callable[[Float64, Float64], Array], across: int = 64) -> Float64:
    """[h, w]: the share of each pixel in which points, in voxels from the middle, are inside."""
    width, height = view.size
    x = (np.arange(width * across) + 0.5) / across - width / 2
    y = height / 2 - (np.arange(height * across) + 0.5) / across
    in_view = np.stack(np.meshgrid(x, y), axis=-1) / view.scale_px
    world = in_view @ view.axes[:2, :2]
    inside = np.asarray(is_inside(world[..., 0], world[..., 1]), np.float64)
    return inside.reshape(height, across, width, across).mean(axis=(1, 3))
