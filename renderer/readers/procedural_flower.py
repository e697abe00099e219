"""Make a flower in a pot as a CT shows it: petals are thin and light, and clay is dense."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from renderer.readers.procedural_grid import Block, blocks, coverage, sine, smooth_noise
from renderer.scene import ProceduralSource
from renderer.volume import Array

# The values of air, of petals at their base, of leaves and the stem, of florets, of earth and of clay.
_AIR, _PETAL, _LEAF, _FLORET, _EARTH, _CLAY = 4, 42, 95, 128, 150, 220
# By how much the tip of a petal is denser than its base.
_TIP = 26
# The share of a turn from one petal, or floret, to the next: the golden angle.
_GOLDEN = 0.3819660112501051
# The numbers of petals and florets.
_NUM_PETALS, _NUM_FLORETS = 44, 150
# The distance from the middle of the flower at which petals begin.
_DISC = 0.09
# The height of the flower above the middle of the volume; half of its width is 0.75.
_HEAD = 0.42


def flower_values(source: ProceduralSource) -> Array:
    """Return the flower, whose petals and florets follow each other by the golden angle, at radii like sqrt(n).

    H. Vogel, "A better way to construct the sunflower head", Mathematical Biosciences 44, 1979.
    """
    values = np.zeros(source.shape[::-1], np.uint8)
    order = np.arange(_NUM_FLORETS) + 0.5
    radius, turns = 0.0115 * np.sqrt(order), order * _GOLDEN
    x, y, z = radius * sine(turns + 0.25), radius * sine(turns), _HEAD + 0.1 - 1.8 * radius * radius
    florets = np.stack([x, y, z], axis=1)
    for block in blocks(source, values, (1.56, 1.56, 2.1)):
        field, blur = np.full(block.out.shape, float(_AIR)), 2 * block.step
        _paint_pot(field, block, source.seed, blur)
        bend = 0.06 * sine(0.4 * block.z)
        stem = np.maximum(np.sqrt((block.x - bend) ** 2 + block.y**2) - 0.032, np.abs(block.z + 0.05) - 0.46)
        field += (_LEAF - field) * coverage(stem, blur)
        for blade in _blades():
            _paint_blade(field, block, *blade)
        for k in block.near(florets - 0.05, florets + 0.05):
            part, at = block.part(florets[k] - 0.05, florets[k] + 0.05)
            x, y, z = part.x - florets[k, 0], part.y - florets[k, 1], (part.z - florets[k, 2]) / 1.8
            distance = np.sqrt(x * x + y * y + z * z) - 0.014
            field[at] += (_FLORET - field[at]) * coverage(distance, blur)
        block.out[...] = np.floor(field + 0.5)
    return values


def _paint_pot(field: Array, block: Block, seed: int, blur: float) -> None:
    radius = np.sqrt(block.x * block.x + block.y * block.y)
    outer = np.where(block.z > -0.62, 0.53, 0.36 + 0.2 * (block.z + 1.02))
    crumbs = 0.07 * smooth_noise(seed, 12 * block.x, 12 * block.y, 12 * block.z)
    earth = np.maximum(radius - outer + 0.05, np.abs(block.z + 0.78) - 0.24 - crumbs)
    field += (_EARTH - field) * coverage(earth, 1.5 * blur)
    wall = np.minimum(outer - 0.06 - radius, block.z + 0.96)
    pot = np.maximum(np.maximum(radius - outer, wall), np.abs(block.z + 0.74) - 0.28)
    field += (_CLAY - field) * coverage(pot, blur)


def _blades() -> Iterator[tuple[float, float, float, float, float, float]]:
    """Yield leaves, which stand lower, and petals from the outermost on.

    They are the direction in turns, the height of the base, the length, half of the width, the slope and the curvature.
    """
    for turns, height, length in ((0.1, -0.42, 0.62), (0.43, -0.35, 0.56), (0.77, -0.25, 0.5)):
        yield turns, height, length, 0.15, 1.1, -1.5
    for k in reversed(range(_NUM_PETALS)):
        age = float(np.sqrt((k + 8) / (_NUM_PETALS + 7)))
        yield k * _GOLDEN, _HEAD, 0.06 + 0.55 * age, 0.05 + 0.06 * age, 1.9 - 1.85 * age, 0.5 - 0.85 * age


def _paint_blade(
    field: Array,
    block: Block,
    turns: float,
    height: float,
    length: float,
    width: float,
    slope: float,
    curvature: float,
) -> None:
    """Draw a leaf or a petal: a thin sheet, curved along and across, and in a petal denser towards its tip."""
    cos, sin = float(sine(turns + 0.25)), float(sine(turns))
    begin = _DISC if height == _HEAD else 0.0
    tip = np.array([cos * (begin + length), sin * (begin + length), 0.0])
    low, high = np.minimum(tip, 0) - width, np.maximum(tip, 0) + width
    low[2], high[2] = height - 0.3, height + 0.6
    part, at = block.part(low, high)
    out, side = cos * part.x + sin * part.y - begin, cos * part.y - sin * part.x
    share = np.clip(out / length, 0, 1)
    breadth = width * 1.6 * np.sqrt(share * (1 - share * share))
    level = height + out * (slope + curvature * out) + 1.6 * side * side
    steep = np.sqrt(1 + (slope + 2 * curvature * out) ** 2)
    thickness = np.abs(part.z - level) / steep - 0.013
    distance = np.maximum(np.maximum(thickness, np.abs(side) - breadth), np.maximum(-out, out - length))
    value = _PETAL + _TIP * share if height == _HEAD else _LEAF
    field[at] += (value - field[at]) * coverage(distance, 1.5 * block.step)
