"""Make a beating heart as a CT with contrast agent shows it: muscle, two kinds of blood, and the great vessels."""

from __future__ import annotations

import itertools

import numpy as np

from renderer.readers.procedural_grid import Block, blocks, coverage, sine, smooth_noise
from renderer.scene import ProceduralSource
from renderer.volume import Array

# The values of air, muscle, blood that comes from the lungs, and blood on its way to them, which has more of the agent.
_AIR, _MUSCLE, _ARTERIAL, _VENOUS = 20, 115, 165, 225
# Chambers: the middle, the radii along x, y, and z downwards and upwards, the wall's thickness, and the blood's value.
_CHAMBERS = (
    ((0.26, 0.28, 0.40), (0.30, 0.26, 0.26, 0.24), 0.035, _ARTERIAL),  # left atrium
    ((-0.38, 0.12, 0.36), (0.28, 0.28, 0.28, 0.28), 0.035, _VENOUS),  # right atrium
    ((-0.14, -0.14, 0.10), (0.48, 0.40, 0.76, 0.28), 0.055, _VENOUS),  # right ventricle
    ((0.20, 0.02, 0.10), (0.44, 0.42, 0.98, 0.28), 0.135, _ARTERIAL),  # left ventricle, whose wall is the septum
)
# Vessels: the radius, the blood's value, and the places between which they are straight.
_VESSELS = (
    (0.09, _ARTERIAL, ((0.1, 0.0, 0.2), (-0.02, 0.0, 0.68), (0.04, 0.1, 0.86), (0.18, 0.26, 0.86), (0.24, 0.4, 0.6))),
    (0.09, _VENOUS, ((-0.1, -0.3, 0.2), (-0.02, -0.26, 0.56), (0.16, -0.06, 0.68), (0.46, 0.06, 0.66))),
    (0.075, _VENOUS, ((-0.38, 0.12, 0.5), (-0.34, 0.14, 0.95))),
)


def heart_values(source: ProceduralSource) -> Array:
    """Return a heart whose ventricles are smallest at 0.4 of a beat, when the apex has turned against the base."""
    values = np.zeros(source.shape[::-1], np.uint8)
    squeeze = _bump((source.phase - 0.4) % 1)
    atria = _bump((source.phase - 0.95) % 1)
    for block in blocks(source, values, (1.7, 1.7, 2.0)):
        x, y, z = _relaxed(block, squeeze)
        blur = 2 * block.step
        field = np.full(block.out.shape, float(_AIR))
        tubes = [(_tube(block, places) - radius, blood) for radius, blood, places in _VESSELS]
        for distance, _ in tubes:
            field += (_MUSCLE - field) * coverage(distance - 0.025, blur)
        rough = 0.06 * smooth_noise(source.seed, 9 * x, 9 * y, 5 * z)
        surfaces = []
        for k, (middle, radii, wall, blood) in enumerate(_CHAMBERS):
            thicker = 1 + (0.8 * squeeze if k > 1 else 0.3 * atria)
            surfaces.append(_chamber(x - middle[0], y - middle[1], z - middle[2], radii))
            field += (_MUSCLE - field) * coverage(surfaces[k], blur)
            field += (blood - field) * coverage(surfaces[k] + wall * thicker + rough * (k > 1), blur)
        for distance, blood in tubes:
            field += (blood - field) * coverage(distance, blur)
        right, left = surfaces[2:]
        arteries = _coronaries(np.minimum(right, left), left - right, z)
        field += (_ARTERIAL - field) * coverage(arteries, blur)
        block.out[...] = np.floor(field + 0.5)
    return values


def _bump(turns: float) -> float:
    """Return 1 at 0 and 0 beyond 0.35 of a beat, with a smooth and even way between them."""
    share = max(0.0, 1 - min(turns, 1 - turns) / 0.35)
    return share * share * (3 - 2 * share)


def _relaxed(block: Block, squeeze: float) -> tuple[Array, Array, Array]:
    """Return the places that points have in the relaxed heart: it shrinks and twists below the base, which descends."""
    low = np.clip((0.5 - block.z) / 0.6, 0, 1)
    scale = 1 - 0.2 * squeeze * low
    turns = 0.05 * squeeze * (-0.1 - block.z)
    sin, cos = sine(turns), sine(turns + 0.25)
    x, y = (cos * block.x + sin * block.y) / scale, (cos * block.y - sin * block.x) / scale
    return x, y, block.z + 0.1 * squeeze * low * np.clip((block.z + 0.9) / 0.6, 0, 1)


def _chamber(x: Array, y: Array, z: Array, radii: tuple[float, ...]) -> Array:
    """Return nearly the signed distance from the surface of an ellipsoid whose upper half has a height of its own."""
    along_z = z / np.where(z < 0, radii[2], radii[3])
    return np.asarray((np.sqrt((x / radii[0]) ** 2 + (y / radii[1]) ** 2 + along_z**2) - 1) * radii[1])


def _tube(block: Block, places: tuple[tuple[float, float, float], ...]) -> Array:
    """Return the distance from a line through places."""
    square = np.full(block.out.shape, np.inf)
    for (sx, sy, sz), (ex, ey, ez) in itertools.pairwise(places):
        dx, dy, dz = ex - sx, ey - sy, ez - sz
        x, y, z = block.x - sx, block.y - sy, block.z - sz
        along = np.clip((x * dx + y * dy + z * dz) / (dx * dx + dy * dy + dz * dz), 0, 1)
        np.minimum(square, (x - along * dx) ** 2 + (y - along * dy) ** 2 + (z - along * dz) ** 2, out=square)
    return np.asarray(np.sqrt(square))


def _coronaries(surface: Array, groove: Array, z: Array) -> Array:
    """Return the signed distance from arteries on a surface.

    One lies where both ventricles are equally near, one around the base, and branches leave the first one downwards.
    """
    lines = [np.sqrt(groove * groove + np.clip(z - 0.25, 0, None) ** 2) - 0.028, np.abs(z - 0.27) - 0.026]
    lines += [np.abs(z + 0.9 * np.abs(groove) + drop) + 0.06 * np.abs(groove) - 0.022 for drop in (-0.1, 0.2, 0.5)]
    nearest = lines[0]
    for line in lines[1:]:
        nearest = np.minimum(nearest, line)
    return np.maximum(nearest, np.abs(surface - 0.01) - 0.022)
