"""Describe light and extinction that depend on the view or on the length of the gradient, for `light.h`.

Light by Lambert's law from a fixed direction is `Optics.light`, which costs less.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.bricks import BrickBatch, texel_gradients
from renderer.transfer import toward_light
from renderer.volume import Float32, Float64, Int32


class Light(NamedTuple):
    """A light of which all samples of a picture share these parameters.

    is_camera: it comes from the viewer, and not from `toward`, a unit vector. is_two_sided, ambient, diffuse, specular,
        shininess: as in ShadingSpec.
    world_from_index: the rows of a matrix of directions; a common factor does not matter.
    factors: float32 [n, 3], a gradient's length in texels, the factor on extinction there, and its slope up to the
        next.
    corners: as in LightField; [0] where all light arrives. grid_shape: x, y, z.
    cells_per_texel: of bricks of voxels. first_cell: the grid's place, in cells, of the volume's centre.
    """

    is_camera: bool
    is_two_sided: bool
    toward: Float64
    ambient: float
    diffuse: float
    specular: float
    shininess: float
    world_from_index: Float64
    factors: Float32
    corners: Int32
    grid_shape: tuple[int, ...]
    cells_per_texel: float
    first_cell: Float64
    occlusion_strength: float
    shadow_strength: float


def make_light(batch: BrickBatch) -> Light | None:
    """Return the light of a batch; None where it has none, or one by Lambert's law alone."""
    shading = batch.shading
    if shading is None or shading.is_plain:
        return None
    field, volume = batch.bricks.light_field, batch.bricks.volume
    grid = field.occlusion if field.occlusion.size else field.shadow
    is_camera = shading.light == "camera"
    world_from_index = volume.world_from_index[:3, :3]
    return Light(
        is_camera,
        shading.two_sided,
        np.zeros(3) if is_camera else toward_light(shading),
        shading.ambient,
        shading.diffuse,
        shading.specular,
        shading.shininess,
        world_from_index / np.abs(world_from_index).max(),
        _factors(batch),
        field.corners,
        grid.shape[::-1],
        1.0 / field.cell_size,
        (volume.centre_index + 0.5) / field.cell_size + 0.5,
        field.occlusion_strength,
        field.shadow_strength,
    )


def _factors(batch: BrickBatch) -> Float32:
    """Return Light.factors."""
    points = np.array((batch.shading and batch.shading.gradient_opacity) or (), np.float64).reshape(-1, 2)
    gradients, factors = texel_gradients(batch.bricks, points[:, 0]), points[:, 1]
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        slopes = (np.append(np.diff(factors) / np.diff(gradients), 0.0)[: len(points)]).astype(np.float32)
    slopes[~np.isfinite(slopes)] = 0.0  # so steep that it is a step
    return np.column_stack([gradients.astype(np.float32), factors.astype(np.float32), slopes])
