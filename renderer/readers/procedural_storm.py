"""Make a hurricane: an eye, its wall, bands of rain that wind around it, and a veil of ice far above."""

from __future__ import annotations

import numpy as np

from renderer.readers.procedural_grid import blocks, sine, smooth_noise
from renderer.scene import ProceduralSource
from renderer.volume import Array

# By how many turns the bands wind from the middle to the edge, and by how many the veil unwinds.
_WINDING, _VEIL_WINDING = 1.15, -0.35
# For each part of the roughness of clouds: how fine it is, its share, and its winding.
_ROUGHNESS = ((5, 0.45, 1.0), (13, 0.3, 0.6), (29, 0.25, 0.3))


def storm_values(source: ProceduralSource) -> Array:
    """Return cloud water from 0 to 120, and rain from 120 to 255, at a phase in turns of the storm.

    Bands are spirals of Archimedes in sqrt(r). The eye widens upwards, as in the picture of J. S. Malkus, "On the
    Structure and Maintenance of the Mature Hurricane Eye", 1958.
    """
    values = np.zeros(source.shape[::-1], np.uint8)
    drift, rise = 0.6 * sine(source.phase), 0.6 * sine(source.phase + 0.25)
    for block in blocks(source, values, (2.0, 2.0, 0.32)):
        height = block.z / 0.32 + 0.5  # 0 at the sea, and 1 at the top
        radius = np.sqrt(block.x * block.x + block.y * block.y)
        rough = np.zeros(block.out.shape)
        for k, share, winding in _ROUGHNESS:
            x, y = _unwound(block.x, block.y, source.phase - winding * np.sqrt(radius))
            rough += share * smooth_noise(source.seed + k, k * x + drift, k * y, 0.16 * k * height + rise)
        x, y = _unwound(block.x, block.y, source.phase - _WINDING * np.sqrt(radius) + 0.12 * rough)
        arms = 0.5 + 0.5 * (x * x - y * y) / (radius * radius + 1e-9)  # 0 to 1: two bands
        eye = 0.05 + 0.05 * height * height
        wall = np.clip(1 - np.abs(radius - eye - 0.12) / 0.16, 0, 1)
        fading = np.clip((1 - radius) / 0.6, 0, 1) * np.clip((radius - eye) / 0.03, 0, 1)
        lift = fading * np.clip(0.1 + 0.75 * arms * arms + 0.6 * wall, 0, 1)
        cloud = np.clip((lift * (2.6 * rough - 0.2) - height) / 0.15, 0, 1)
        vx, vy = _unwound(block.x, block.y, source.phase - _VEIL_WINDING * np.sqrt(radius))
        veil = smooth_noise(source.seed, 3 * vx, 9 * vy, np.zeros_like(block.z)) - 0.45
        veil = veil * np.clip(1 - np.abs(height - 0.86) / 0.1, 0, 1) * np.clip((radius - 0.25) / 0.1, 0, 1) * fading
        rain = cloud * np.clip((wall + arms * fading) * (0.4 + rough) * (1.1 - height) - 0.35, 0, 1)
        field = np.maximum(120 * cloud * np.clip(0.35 + rough, 0, 1), 60 * np.clip(veil, 0, 1))
        block.out[...] = np.floor(np.clip(field + 170 * rain, 0, 255) + 0.5)
    return values


def _unwound(x: Array, y: Array, turns: Array) -> tuple[Array, Array]:
    """Return the place from which a point comes that turned anticlockwise around z."""
    sin, cos = sine(turns), sine(turns + 0.25)
    return cos * x + sin * y, cos * y - sin * x
