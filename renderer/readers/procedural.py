"""Make volumes from formulas, for the demo, the gallery and the tests, without a file.

All volumes are uint8, with the origin at the centre of voxel (0, 0, 0). Their bytes are the same on every machine: all
but `marschner_lobb` use only correctly rounded operations and integer random numbers, and `marschner_lobb`, the only
formula with sines, is rounded to 8 bits.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np

from renderer.readers.procedural_cell import cell_values
from renderer.readers.procedural_engine_block import engine_block_values
from renderer.readers.procedural_flower import flower_values
from renderer.readers.procedural_grid import random_bytes, row_blocks
from renderer.readers.procedural_heart import heart_values
from renderer.readers.procedural_rock import rock_values
from renderer.readers.procedural_storm import storm_values
from renderer.readers.procedural_vessels import vessel_values
from renderer.scene import ProceduralSource
from renderer.volume import Array


def procedural_values(source: ProceduralSource) -> Array:
    """Return the values of the formula that `source` names, uint8 [z, y, x]."""
    makers: dict[str, Callable[[ProceduralSource], Array]] = {
        "engine_block": engine_block_values,
        "constant": lambda source: np.full(source.shape[::-1], 200, np.uint8),
        "single_voxel": _single_voxel,
        "marschner_lobb": _marschner_lobb,
        "cell_nuclei": functools.partial(_cells, inner=0.0, outer=0.5),
        "cell_membranes": functools.partial(_cells, inner=0.86, outer=1.0),
        "atlas": _atlas,
        "beating_heart": heart_values,
        "vessels": vessel_values,
        "cell_plasma_membrane": functools.partial(cell_values, channel="membrane"),
        "cell_nucleus": functools.partial(cell_values, channel="nucleus"),
        "cell_reticulum": functools.partial(cell_values, channel="reticulum"),
        "cell_mitochondria": functools.partial(cell_values, channel="mitochondria"),
        "cell_vesicles": functools.partial(cell_values, channel="vesicles"),
        "porous_rock": rock_values,
        "storm": storm_values,
        "flower": flower_values,
    }
    return makers[source.name](source)


def _single_voxel(source: ProceduralSource) -> Array:
    """Return a volume with one voxel set, at index n // 2 of each axis."""
    values = np.zeros(source.shape[::-1], np.uint8)
    values[tuple(n // 2 for n in values.shape)] = 255
    return values


def _marschner_lobb(source: ProceduralSource) -> Array:
    """Return the reconstruction test signal over [-1, 1]^3, both ends included, with [0, 1] stretched over 0 to 255.

    S. R. Marschner, R. J. Lobb, "An Evaluation of Reconstruction Filters for Volume Rendering", Visualization 1994,
    equation 3, with f_M = 6 and alpha = 0.25: `rho = (1 - sin(pi z / 2) + alpha (1 + rho_r(r))) / (2 (1 + alpha))`,
    `rho_r(r) = cos(2 pi f_M cos(pi r / 2))`, `r = sqrt(x^2 + y^2)`.
    """
    f_M, alpha = 6.0, 0.25
    x, y, z = (np.linspace(-1.0, 1.0, n) if n > 1 else np.zeros(1) for n in source.shape)
    values = np.empty(source.shape[::-1], np.uint8)
    for rows in row_blocks(source):
        r = np.sqrt(x**2 + y[rows, np.newaxis] ** 2)
        rho_r = np.cos(2 * np.pi * f_M * np.cos(np.pi * r / 2))
        for plane, z_plane in zip(values, z, strict=True):
            rho = (1 - np.sin(np.pi * z_plane / 2) + alpha * (1 + rho_r)) / (2 * (1 + alpha))
            plane[rows] = np.floor(255 * rho + 0.5)
    return values


# The centre and the radii of each cell, an ellipsoid in [-1, 1]^3.
_CELLS = (
    (-0.45, -0.4, -0.1, 0.5, 0.45, 0.6), (0.4, -0.5, 0.05, 0.48, 0.42, 0.7), (0.0, 0.15, -0.15, 0.42, 0.4, 0.65),
    (-0.55, 0.5, 0.1, 0.4, 0.45, 0.6), (0.55, 0.45, 0.0, 0.42, 0.5, 0.75),
)  # fmt: skip
# The width of the blurred edge of a cell, as a share of its radius.
_CELL_BLUR = 0.06


def _cells(source: ProceduralSource, *, inner: float, outer: float) -> Array:
    """Return cells that are filled between two shares of their radii, like one channel of a microscope.

    inner, outer: the two shares, 0 at the centre of a cell and 1 at its surface: nuclei begin at 0, and membranes end
    at 1.
    """
    x, y, z = (np.linspace(-1.0, 1.0, n) if n > 1 else np.zeros(1) for n in source.shape)
    values = np.empty(source.shape[::-1], np.uint8)
    for rows in row_blocks(source):
        for plane, z_plane in zip(values[:, rows], z, strict=True):
            filled = np.zeros(plane.shape)
            for cx, cy, cz, rx, ry, rz in _CELLS:
                radius = ((x - cx) / rx) ** 2 + (((y[rows] - cy) / ry) ** 2)[:, np.newaxis]
                radius += ((z_plane - cz) / rz) ** 2
                np.sqrt(radius, out=radius)
                inside = np.minimum(radius - inner, outer - radius) if inner > 0 else outer - radius
                inside /= _CELL_BLUR
                inside += 0.5
                np.maximum(filled, np.minimum(inside, 1.0), out=filled)
            plane[:] = np.floor(20 + 200 * filled + 0.5)
    return values


# The number of labels of the atlas.
_NUM_LABELS = 200
# The radius of the atlas, a ball in [-1, 1]^3.
_BALL = 0.95
# Half of the width of the gap between two labels of the atlas, in coordinates in which the radius is _BALL.
_GAP = 0.012


def _atlas(source: ProceduralSource) -> Array:
    """Return a ball in [-1, 1]^3 with the labels 1 to 200: a point has the label of the nearest of 200 seed points.

    The seed points are random, by the seed of `source`. A gap between labels gives each of them a surface.
    """
    places = _places_in_ball(source.seed)
    x, y, z = (np.linspace(-1.0, 1.0, n, dtype=np.float32) if n > 1 else np.zeros(1, np.float32) for n in source.shape)
    values = np.zeros(source.shape[::-1], np.uint8)
    for rows in row_blocks(source):
        for plane, z_plane in zip(values[:, rows], z, strict=True):
            nearest = second = np.full(plane.shape, np.float32(np.inf))
            for label, (at_x, at_y, at_z) in enumerate(places, 1):
                distance = (x - at_x) ** 2 + ((y[rows, np.newaxis] - at_y) ** 2 + (z_plane - at_z) ** 2)
                plane[distance < nearest] = label
                second = np.clip(distance, nearest, second)
                nearest = np.minimum(nearest, distance)
            is_between = np.sqrt(second) - np.sqrt(nearest) < 2 * _GAP
            plane[is_between | (x**2 + (y[rows, np.newaxis] ** 2 + z_plane**2) > _BALL**2)] = 0
    return values


def _places_in_ball(seed: int) -> Array:
    places = random_bytes(seed, 0, 3 * 3 * _NUM_LABELS).astype(np.float64).reshape(-1, 3) / 127.5 - 1
    return np.asarray(places[(places**2).sum(axis=1) < _BALL**2][:_NUM_LABELS], np.float32)
