"""Ambient occlusion and soft shadows from their definitions: many rays in fine steps, in plain float64.

Extinctions of voxels are interpolated linearly. Two numbers that the definitions leave open are the renderer's: the
length of the first part of a ray, which is left out, and the size of the light.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from renderer.transfer import TransferFunction
from renderer.volume import Float32, Float64, Volume

# The distance from a lit point at which a ray towards the light begins, in cells of the light grid.
START_CELLS = 2

# The length of the rays of ambient occlusion, as a share of the diagonal of the volume.
OCCLUSION_RADIUS = 0.1

# The angle, in degrees, from the middle of the light to its edge.
LIGHT_RADIUS = 14.0

NUM_OCCLUSION_RAYS, NUM_LIGHT_RAYS = 256, 64
# The step along rays, in units of the finest spacing.
STEP = 0.5


def exact_occlusion(
    volume: Volume, transfer: TransferFunction, points: Float64, cell_size: int, radius: float | None = None
) -> Float64:
    """Return the share of ambient light that reaches points, [n].

    points: [n, 3] (x, y, z), in index coordinates. cell_size: the side of a light grid's cell, in voxels. radius: the
    length of rays in the world; None for OCCLUSION_RADIUS.
    """
    if radius is None:
        radius = OCCLUSION_RADIUS * 2 * volume.half_diagonal
    # directions in rings of equal area on the sphere, each ring with its own random turn
    rng = np.random.default_rng(5)
    heights = (np.arange(16) + 0.5) / 8 - 1
    turns = (2 * np.pi * (np.arange(NUM_OCCLUSION_RAYS // 16) / 16 + rng.random((16, 1)))).ravel()
    across = np.repeat(np.sqrt(1 - heights**2), NUM_OCCLUSION_RAYS // 16)
    directions = np.stack([across * np.cos(turns), across * np.sin(turns), np.repeat(heights, 16)], axis=1)
    return np.minimum(1, 2 * _transmission(volume, transfer, points, directions, (cell_size, radius)))


def exact_shadow(
    volume: Volume, transfer: TransferFunction, points: Float64, cell_size: int, light: tuple[float, float, float]
) -> Float64:
    """Return the share of the light of a disc that reaches points, [n].

    points: [n, 3] (x, y, z), in index coordinates. cell_size: the side of a light grid's cell, in voxels. light: the
    direction towards the middle of the disc.
    """
    toward = np.array(light) / np.linalg.norm(light)
    _, _, rows = np.linalg.svd(toward[None])  # the last two rows are at right angles to `toward`
    rng = np.random.default_rng(6)
    radii = np.sqrt((np.arange(NUM_LIGHT_RAYS) + rng.random(NUM_LIGHT_RAYS)) / NUM_LIGHT_RAYS)
    turns = 2 * np.pi * (np.arange(NUM_LIGHT_RAYS) * 0.618034 + rng.random())
    disc = np.stack([radii * np.cos(turns), radii * np.sin(turns)], axis=1) @ rows[1:]
    directions = toward + np.tan(np.radians(LIGHT_RADIUS)) * disc
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return _transmission(volume, transfer, points, directions, (cell_size, float("inf")))


def _transmission(
    volume: Volume, transfer: TransferFunction, points: Float64, directions: Float64, limits: tuple[int, float]
) -> Float64:
    """Return the mean transmittance over directions [m, 3], for each point, [n].

    limits: the side of a light grid's cell in voxels, and the length of rays in the world.
    """
    finest = volume.finest_spacing
    extinctions = transfer.classify(volume.values)[1]
    start, end = START_CELLS * limits[0] * finest, min(limits[1], volume.spacing @ volume.shape_xyz)
    middles = np.arange(start + STEP * finest / 2, end, STEP * finest)
    to_index = directions @ np.linalg.inv(volume.world_from_index[:3, :3]).T
    shape, depths = np.array(volume.shape_xyz), np.zeros((len(points), len(directions)))
    for middle in middles:
        places = points[:, None] + middle * to_index
        inside = np.all((places >= -0.5) & (places <= shape - 0.5), axis=2)
        if not inside.any():
            break
        found = ndimage.map_coordinates(extinctions, places[inside].T[::-1], order=1, mode="nearest")
        depths[inside] += STEP * finest * found
    return np.exp(-depths).mean(axis=1)


def sampled(factors: Float32, cell_size: int, points: Float64) -> Float64:
    """Return the factors of a light grid, interpolated at points [n, 3] (x, y, z) in index coordinates."""
    places = (points + 0.5) / cell_size + 0.5
    return np.asarray(ndimage.map_coordinates(factors.astype(np.float64), places.T[::-1], order=1, mode="nearest"))
