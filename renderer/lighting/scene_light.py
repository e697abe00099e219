"""Solve for the light of a scene: its sources, and the mean radiance with its exposure, as pictures show it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.cache import NOT_KEPT, KeptArrays
from renderer.lighting.environment import LightSources
from renderer.lighting.exposure import choose_stops
from renderer.lighting.matter_grid import Matter
from renderer.lighting.radiance_grid import RadianceGrid, compute_radiance_grid
from renderer.scene import LightSpec, SurfaceSpec, Vector
from renderer.transfer import linear_of_srgb
from renderer.volume import Array, Float32, Float64

# The number of numbers of a cell with flux: a line of the processor's cache.
_NUMBERS_WITH_FLUX = 16


class SurfaceLight(NamedTuple):
    """The light on surfaces in the matter of a scene."""

    # How surfaces reflect light.
    spec: SurfaceSpec
    # The unit vector to the middle of the key light.
    key: Vector
    # [rgb]: the irradiance of the key light, divided by pi, times the exposure.
    key_light: Float64


class SceneLight(NamedTuple):
    """The light in the matter of a scene, on a grid with the axes of the world. It is linear between cells' middles."""

    # [3]: the lowest corner (x, y, z) of the grid in the world. The middle of cell i is i + 1/2 widths from it.
    origin: Float64
    # The width of a cell, in the world.
    cell: float
    # [z, y, x, 4]: the mean radiance (r, g, b), times the exposure; matter shows its albedo times it. The fourth number
    # is the share of the key light that arrives straight. With surfaces [z, y, x, 16]: then the flux, as in
    # RadianceGrid, times the exposure, along x (r, g, b), y and z. The last three numbers are 0.
    radiance: Float32
    # The exposure: the power of 2 by which all light was multiplied.
    stops: float
    # The light on surfaces; None if no point is a surface.
    surface: SurfaceLight | None


def solve_scene_light(
    layers: Sequence[Matter],
    light: LightSpec,
    *,
    stops: float | None = None,
    num_threads: int = 1,
    kept: KeptArrays = NOT_KEPT,
) -> SceneLight:
    """Return the light of a scene in layers of matter. The result does not depend on the number of threads.

    stops: the exposure in place of one that is chosen, if the scene leaves it open.
    kept: the entry in which the same light was kept, or is kept now.

    Raises InputError if the light does not fit into memory, or if a volume's file was changed.
    """
    sources = sources_of(light)
    with kept.making() as found:
        arrays = found
        if arrays is None:
            grid = compute_radiance_grid(
                layers,
                sources,
                max_cells=light.cells,
                with_flux=sources.surface is not None,
                num_threads=num_threads,
            )
            stops = stops if light.exposure is None else light.exposure
            arrays = _shown(grid, choose_stops(grid, sources) if stops is None else stops)
            kept.keep(arrays)
    *origin, cell, stops = arrays["place"].tolist()
    surface = None
    if sources.surface is not None:
        key_light = sources.key_irradiance / np.pi * 2.0**stops
        surface = SurfaceLight(sources.surface, sources.key, key_light)
    return SceneLight(np.array(origin), cell, arrays["radiance"], stops, surface)


def _shown(grid: RadianceGrid, stops: float) -> dict[str, Array]:
    """Return `radiance` as pictures show it, and `place`: the origin, the cell and the exposure."""
    exposure, shape = np.float32(2.0**stops), grid.mean_radiance.shape[:3]
    radiance = np.zeros((*shape, 4 if grid.flux is None else _NUMBERS_WITH_FLUX), np.float32)
    radiance[..., :3] = grid.mean_radiance * exposure
    radiance[..., 3] = grid.key
    if grid.flux is not None:
        radiance[..., 4:13] = grid.flux.reshape(*shape, 9) * exposure
    return {"place": np.array([*grid.origin, grid.cell, stops]), "radiance": radiance}


def sources_of(light: LightSpec) -> LightSources:
    """Return the sources of light of a scene, in linear light."""
    top, horizon, bottom = (
        linear_of_srgb(color) for color in (light.environment.top, light.environment.horizon, light.environment.bottom)
    )
    mean = (top + bottom) / 2
    # The quadratic in the cosine with these values at 1, 0 and -1, as a sum of P0, P1 and P2.
    bands = np.stack([(mean + 2 * horizon) / 3, (top - bottom) / 2, (mean - horizon) * 2 / 3])
    key, radius, irradiance = (0.0, 0.0, 1.0), 14.0, np.zeros(3)
    if light.key is not None:
        assert isinstance(light.key.direction, tuple), "with_key_of_camera gives the directions"
        key, radius = _unit(light.key.direction), light.key.radius
        irradiance = np.pi * light.key.strength * linear_of_srgb(light.key.color)
    return LightSources(_unit(light.up), bands, key, radius, irradiance, light.scattering, light.surfaces)


def _unit(vector: Vector) -> Vector:
    x, y, z = (component / max(map(abs, vector)) for component in vector)
    length = float(np.sqrt(x * x + y * y + z * z))
    return x / length, y / length, z / length
