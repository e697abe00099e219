"""Make a core of sandstone as a micro-CT shows it: grains of several minerals and sizes, cement, and pores."""

from __future__ import annotations

import numpy as np

from renderer.readers.procedural_grid import Block, blocks, coverage, random_places, smooth_noise
from renderer.scene import ProceduralSource
from renderer.volume import Array

# The value of air around the core, and of the fluid in its pores.
_AIR, _FLUID = 8, 62
# The values of minerals, each as often as it is here: quartz, feldspar, and a few grains of an ore.
_MINERALS = np.array([142, 150, 146, 139, 176, 148, 144, 182, 151, 141, 236, 147])
# The radii of grains, from the coarsest to the finest, each with the number of places that are tried.
_SIZES = ((0.20, 400), (0.15, 700), (0.11, 1200), (0.075, 2500), (0.05, 4000))
# By how much a grain grows beyond its ball, as a share of its radius: grown grains meet in flat faces.
_GROWTH = 0.2


def rock_values(source: ProceduralSource) -> Array:
    """Return a round core along z: each point is of the grain whose ball is nearest, if it lies in the grown ball.

    Balls are packed at random, the coarsest first; cracks between grains, where two balls are equally near, are open.
    """
    values = np.zeros(source.shape[::-1], np.uint8)
    centres, radii = _packed_balls(source.seed)
    minerals = _MINERALS[np.arange(len(radii)) % len(_MINERALS)]
    for block in blocks(source, values, (2.0, 2.0, 2.0)):
        blur = 1.4 * block.step
        core = coverage(np.sqrt(block.x * block.x + block.y * block.y) - 0.96, blur)
        core = core * coverage(np.abs(block.z) - 0.97, blur)
        nearest, second, mineral = _grains(block, centres, radii, minerals)
        rough = 0.05 * smooth_noise(source.seed, 8 * block.x, 8 * block.y, 8 * block.z)
        stone = coverage(nearest + rough - 0.03, blur) * coverage(0.006 - 0.5 * (second - nearest), blur)
        grain = 10 * smooth_noise(source.seed + 1, 40 * block.x, 40 * block.y, 40 * block.z) - 5
        field = _FLUID + grain + (mineral - _FLUID) * stone
        block.out[...] = np.floor(_AIR + 0.5 + (field - _AIR) * core)
    return values


def _grains(block: Block, centres: Array, radii: Array, minerals: Array) -> tuple[Array, Array, Array]:
    """Return signed distances to the nearest grain and the second nearest, and the value of the nearest grain.

    Distances are at most 0.2, as far from a grain as that.
    """
    nearest, second, mineral = np.full(block.out.shape, 0.2), np.full(block.out.shape, 0.2), np.zeros(block.out.shape)
    reach = radii[:, None] * (1 + _GROWTH) + 0.05
    for k in block.near(centres - reach, centres + reach):
        part, at = block.part(centres[k] - reach[k], centres[k] + reach[k])
        x, y, z = part.x - centres[k, 0], part.y - centres[k, 1], part.z - centres[k, 2]
        distance = np.sqrt(x * x + y * y + z * z) - radii[k] * (1 + _GROWTH)
        second[at] = np.clip(distance, nearest[at], second[at])
        mineral[at] = np.where(distance < nearest[at], minerals[k], mineral[at])
        nearest[at] = np.minimum(nearest[at], distance)
    return nearest, second, mineral


def _packed_balls(seed: int) -> tuple[Array, Array]:
    """Return centres and radii of balls that do not overlap."""
    centres, radii = np.zeros((0, 3)), np.zeros(0)
    for k, (radius, num) in enumerate(_SIZES):
        for place in random_places(seed + k, num):
            x, y, z = (centres - place).T
            if (x * x + y * y + z * z > (radii + radius) ** 2).all():
                centres, radii = np.concatenate([centres, place[None]]), np.append(radii, radius)
    return centres, radii
