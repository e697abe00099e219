"""Find the blocks of a level of a store that exact rays need: those near the rays."""

from __future__ import annotations

from itertools import product

import numpy as np

from renderer.kernels import IndexRays
from renderer.readers import Blocks
from renderer.volume import Bools, Float64

# The distance of two points of a ray around which blocks are marked, in voxels.
_STEP = 4.0
# The distance from a ray, along each axis and in voxels, within which exact rays look at voxels: they skip macrocells
# of 4 cells along each axis.
_REACH = 4.0


def crossed_blocks(blocks: Blocks, box: tuple[tuple[int, int], ...], rays: IndexRays) -> Bools:
    """Return which blocks of a level rays need: bool [z, y, x].

    box: the ranges of voxels of the level, along x, y, z, that the volume has. rays: in the index space of the volume.
    """
    found = np.zeros(blocks.wanted.shape, np.bool_)
    firsts, ends = np.array(box, np.float64).T
    reach = _REACH + 0.5 * _STEP
    sides = np.array(blocks.size)
    counts = np.ceil(2 * reach / sides).astype(int) + 1
    around = np.array([*product(*(np.linspace(-reach, reach, count) for count in counts))])
    last = np.array(found.shape[::-1]) - 1
    for origin, direction, parts in zip(rays.origins, rays.directions, rays.parts, strict=True):
        points = _points(origin, direction, parts, reach, ends - firsts)
        near = points[:, None] + around + firsts
        x, y, z = np.clip(np.floor((near + 0.5) / sides), 0, last).astype(np.int64).reshape(-1, 3).T
        found[z, y, x] = True
    return found


def _points(origin: Float64, direction: Float64, parts: Float64, reach: float, lengths: Float64) -> Float64:
    """Return points of a ray near a volume of these lengths in voxels, at most _STEP apart: float64 [n, 3]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        to_low, to_high = (-0.5 - reach - origin) / direction, (lengths - 0.5 + reach - origin) / direction
    enter, leave = np.fmin(to_low, to_high), np.fmax(to_low, to_high)
    begin = max(float(np.max(enter)), float(parts[:, 0].min(initial=np.inf)))
    end = min(float(np.min(leave)), float(parts[:, 1].max(initial=-np.inf)))
    if not begin < end:
        return np.empty((0, 3))
    num = int(np.ceil((end - begin) * np.linalg.norm(direction) / _STEP)) + 1
    return np.asarray(origin + np.linspace(begin, end, num)[:, None] * direction)
