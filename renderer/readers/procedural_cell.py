"""Make a cell with its organelles, a volume for each channel of a microscope."""

from __future__ import annotations

import numpy as np

from renderer.readers.procedural_grid import Block, blocks, coverage, random_places, sine, smooth_noise
from renderer.scene import ProceduralSource
from renderer.volume import Array

# The radii of the cell, an ellipsoid.
_RADII = np.array([0.92, 0.82, 0.5])
# The centre and the radius of the nucleus.
_NUCLEUS, _NUCLEUS_RADIUS = np.array([-0.16, 0.06, 0.0]), 0.33
# For each kind of organelle: how many there are at most, their half length without the ends, and their radius.
_ORGANELLES = {"mitochondria": (46, 0.085, 0.042), "vesicles": (150, 0.0, 0.036)}


def cell_values(source: ProceduralSource, channel: str) -> Array:
    """Return one channel: 20 is dark and 220 full. The places of organelles depend on the seed, not on the channel."""
    values = np.zeros(source.shape[::-1], np.uint8)
    organelles = _organelle_places(source.seed, channel) if channel in _ORGANELLES else None
    for block in blocks(source, values, (2.0, 1.8, 1.1)):
        x, y, z = block.x - _NUCLEUS[0], block.y - _NUCLEUS[1], block.z - _NUCLEUS[2]
        around = np.sqrt(x * x + y * y + z * z) - _NUCLEUS_RADIUS  # the distance from the nucleus
        blur = 1.2 * block.step
        if organelles is not None:
            filled = _organelles(block, channel, *organelles)
        elif channel == "membrane":
            waves = 0.06 * smooth_noise(source.seed, 4 * block.x, 4 * block.y, 4 * block.z)
            radius = np.sqrt((block.x / 0.92) ** 2 + (block.y / 0.82) ** 2 + (block.z / 0.5) ** 2)
            filled = coverage(0.5 * np.abs(radius - 0.93 - waves) - 0.012, blur)
        elif channel == "nucleus":
            grains = 0.3 + 0.3 * smooth_noise(source.seed + 1, 14 * x, 14 * y, 14 * z)
            nucleolus = np.sqrt((x - 0.09) ** 2 + (y + 0.05) ** 2 + (z - 0.03) ** 2) - 0.1
            filled = np.maximum(coverage(around, blur) * grains, 0.8 * coverage(np.abs(around) - 0.012, blur))
            filled = np.maximum(filled, coverage(nucleolus, blur))
        else:  # the reticulum: folded sheets around the nucleus
            folds = np.abs(smooth_noise(source.seed + 2, 9 * x, 9 * y, 9 * z) - 0.5) / 9
            filled = coverage(folds - 0.006, blur) * coverage(np.abs(around - 0.12) - 0.07, 0.06)
        block.out[...] = np.floor(20.5 + 200 * filled)
    return values


def _organelle_places(seed: int, channel: str) -> tuple[Array, Array]:
    """Return centres and halves of axes of organelles that lie apart, between nucleus and membrane."""
    most, half, radius = _ORGANELLES[channel]
    places = random_places(seed + 3 + len(channel), 10 * most, 6)
    centres, axes = places[:, :3] * _RADII, places[:, 3:] * [1, 1, 0.5]
    axes *= half / np.sqrt(_square(axes))[:, None]
    apart = np.sqrt(_square(centres - _NUCLEUS)) > _NUCLEUS_RADIUS + 0.03 + radius + half
    inside = _square(centres / (_RADII - radius - half)) < 0.87**2
    kept: list[int] = []
    for k in np.flatnonzero(apart & inside):
        if len(kept) < most and (_square(centres[kept] - centres[k]) > (2 * radius + half) ** 2).all():
            kept.append(int(k))
    return centres[kept], axes[kept]


def _organelles(block: Block, channel: str, centres: Array, axes: Array) -> Array:
    """Return mitochondria, rods with cristae across them, or vesicles, hollow balls."""
    _, half, radius = _ORGANELLES[channel]
    filled, blur = np.zeros(block.out.shape), 1.2 * block.step
    reach = np.abs(axes) + radius + blur
    for k in block.near(centres - reach, centres + reach):
        part, at = block.part(centres[k] - reach[k], centres[k] + reach[k])
        (dx, dy, dz), (cx, cy, cz) = axes[k], centres[k]
        x, y, z = part.x - cx, part.y - cy, part.z - cz
        along = np.clip((x * dx + y * dy + z * dz) / max(half * half, 1e-9), -1, 1)
        distance = np.sqrt((x - along * dx) ** 2 + (y - along * dy) ** 2 + (z - along * dz) ** 2) - radius
        cristae = 0.5 + 0.2 * sine(3.0 * along) if half else 0.25
        inside = np.maximum(cristae * coverage(distance, blur), coverage(np.abs(distance + 0.009) - 0.009, blur))
        np.maximum(filled[at], inside, out=filled[at])
    return filled


def _square(vectors: Array) -> Array:
    return np.asarray(vectors[:, 0] ** 2 + vectors[:, 1] ** 2 + vectors[:, 2] ** 2)
