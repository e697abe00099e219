"""Describe light and extinction that depend on the view or on the length of the gradient, for `light.h`, the light in
matter that scatters it, for `radiance.h`, and fog, for `fog.h`.

Light that follows Lambert's law and has a fixed direction is in `Field.lambert` instead, which costs less time.
"""

from __future__ import annotations

import numpy as np

from renderer.bricks import BrickLayer, BrickLayers, texel_change, texel_gradients
from renderer.kernels import FogRamp, Light, RadianceCells, Shading, SurfaceCells
from renderer.lighting import SurfaceLight
from renderer.transfer import toward_light
from renderer.view import View
from renderer.volume import Float32, Volume


def make_light(layer: BrickLayer) -> Light | None:
    """Return the record Light of kernels for a layer; None without light, or if `Field.lambert` is all of it."""
    shading = layer.shading
    if shading is None or shading.is_plain:
        return None
    grid, volume = layer.bricks.light_grid, layer.bricks.volume
    is_camera = shading.light == "camera"
    world_from_index = volume.world_from_index[:3, :3]
    return Light(
        shading=Shading(
            ambient=shading.ambient,
            diffuse=shading.diffuse,
            specular=shading.specular,
            shininess=shading.shininess,
            silhouette=shading.silhouette,
            two_sided=shading.two_sided,
        ),
        grid=grid,
        is_camera=is_camera,
        toward=np.zeros(3) if is_camera else toward_light(shading),
        world_from_index=world_from_index / np.abs(world_from_index).max(),
        factors=_factors(layer),
        first_cell=(volume.centre_index + 0.5) / grid.cell_size + 0.5,
        change_per_length=texel_change(layer.bricks),
    )


def _factors(layer: BrickLayer) -> Float32:
    """Return the factors by which the length of the gradient changes a layer's extinction, as in `Light.factors`."""
    points = np.array((layer.shading and layer.shading.gradient_opacity) or (), np.float64).reshape(-1, 2)
    gradients, factors = texel_gradients(layer.bricks, points[:, 0]), points[:, 1]
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        slopes = (np.append(np.diff(factors) / np.diff(gradients), 0.0)[: len(points)]).astype(np.float32)
    slopes[~np.isfinite(slopes)] = 0.0  # an infinite slope is a step
    return np.column_stack([gradients.astype(np.float32), factors.astype(np.float32), slopes])


def fog_ramp(view: View, volume: Volume) -> FogRamp | None:
    """Return the record FogRamp of kernels for a volume; None for a view without fog."""
    if view.fog is None:
        return None
    share, per_index = view.fog_share(view.fog, volume.centre, volume.world_from_index[:3, :3].T)
    return FogRamp(color=np.array(view.fog.color), share=float(share), per_index=per_index)


def radiance_cells(layers: BrickLayers) -> RadianceCells | None:
    """Return the record RadianceCells of kernels for layers on one grid of voxels; None if they scatter no light."""
    light, volume = layers.light, layers.volume
    if light is None:
        return None
    origin = (volume.centre - light.origin) / light.cell - 0.5
    cells_from_index = np.column_stack([volume.world_from_index[:3, :3] / light.cell, origin])
    return RadianceCells(
        cells=light.radiance,
        surface=None if light.surface is None else _surface_cells(light.surface),
        cells_from_index=cells_from_index.ravel(),
    )


def _surface_cells(surface: SurfaceLight) -> SurfaceCells:
    return SurfaceCells(
        share=surface.spec.share,
        specular=surface.spec.specular,
        shininess=surface.spec.shininess,
        key=np.array(surface.key, np.float64),
        key_light=surface.key_light,
    )
