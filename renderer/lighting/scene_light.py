"""Solve for the light of a scene: its sources, and the mean radiance with its exposure, as pictures show it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.lighting.environment import LightSources
from renderer.lighting.exposure import choose_stops
from renderer.lighting.matter_grid import Matter
from renderer.lighting.radiance_grid import compute_radiance_grid
from renderer.scene import LightSpec, Vector
from renderer.transfer import linear_of_srgb
from renderer.volume import Float32, Float64


class SceneLight(NamedTuple):
    """The light in the matter of a scene, on a grid with the axes of the world. It is linear between cells' middles."""

    # [3]: the lowest corner (x, y, z) of the grid in the world. The middle of cell i is i + 1/2 widths from it.
    origin: Float64
    # The width of a cell, in the world.
    cell: float
    # [z, y, x, 4]: the mean radiance (r, g, b), times the exposure; matter shows its albedo times it. The fourth number
    # is 0.
    radiance: Float32
    # The exposure: the power of 2 by which all light was multiplied.
    stops: float


def solve_scene_light(
    layers: Sequence[Matter], light: LightSpec, *, stops: float | None = None, num_threads: int = 1
) -> SceneLight:
    """Return the light of a scene in layers of matter. The result does not depend on the number of threads.

    stops: the exposure in place of one that is chosen, if the scene leaves it open.

    Raises InputError if the light does not fit into memory, or if a volume's file was changed.
    """
    grid = compute_radiance_grid(layers, sources_of(light), num_threads=num_threads)
    stops = stops if light.exposure is None else light.exposure
    stops = choose_stops(grid) if stops is None else stops
    radiance = np.zeros((*grid.mean_radiance.shape[:3], 4), np.float32)
    radiance[..., :3] = grid.mean_radiance * np.float32(2.0**stops)
    return SceneLight(grid.origin, grid.cell, radiance, stops)


def sources_of(light: LightSpec) -> LightSources:
    """Return the sources of light of a scene, in linear light."""
    top, horizon, bottom = (
        linear_of_srgb(color) for color in (light.environment.top, light.environment.horizon, light.environment.bottom)
    )
    mean = (top + bottom) / 2
    # The quadratic in the cosine with these values at 1, 0 and -1, as a sum of P0, P1 and P2.
    bands = np.stack([(mean + 2 * horizon) / 3, (top - bottom) / 2, (mean - horizon) * 2 / 3])
    if light.key is None:
        return LightSources(_unit(light.up), bands, (0.0, 0.0, 1.0), 14.0, np.zeros(3))
    irradiance = np.pi * light.key.strength * linear_of_srgb(light.key.color)
    return LightSources(_unit(light.up), bands, _unit(light.key.direction), light.key.radius, irradiance)


def _unit(vector: Vector) -> Vector:
    x, y, z = (component / max(map(abs, vector)) for component in vector)
    length = float(np.sqrt(x * x + y * y + z * z))
    return x / length, y / length, z / length
