"""Join the bricks of layers that lie on one grid of voxels, so that they are cut and drawn as one.

At every point, the extinctions of the layers add up, multiplied by their weights. The error that a brick of several
layers may cause in a pixel is at most the weighted sum of the layers' errors: two copies of a volume, each with half of
the weight, have the cut and the steps of one volume.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from renderer.bricks.bricks import BrickLevel, Bricks
from renderer.bricks.layout import HALO, PADDED_BRICK_SIZE
from renderer.bricks.texels import voxel_texels
from renderer.kernels import VoxelTexels
from renderer.lighting import SceneLight
from renderer.scene import ClipSpec, ShadingSpec
from renderer.volume import Volume


@dataclass(frozen=True)
class BrickLayer:
    """A layer as bricks, with its shading. weight: the factor on the layer's extinction."""

    bricks: Bricks
    shading: ShadingSpec | None = None
    weight: float = 1.0

    @property
    def lights_faces(self) -> bool:
        """Return whether the faces that clipping cuts are lit by their own normals.

        If voxels are colours, faces have no light of their own: such voxels are lit before they are interpolated.
        """
        return self.shading is not None and self.shading.cut_faces and self.bricks.volume.colors is None

    @cached_property
    def voxel_texels(self) -> VoxelTexels | None:
        """Return the form of texels of level 0 that are voxels; None if they must be float32."""
        return voxel_texels(self.bricks)

    def texel_floats(self, *, keeps_voxels: bool) -> int:
        """Return the number of floats, or of words of four bytes, that the texels of a brick of level 0 take.

        keeps_voxels: whether texels are voxels where they can be.
        """
        if keeps_voxels and self.voxel_texels is not None:
            side = PADDED_BRICK_SIZE + (2 * HALO if self.shading else 0)  # gradients need one more voxel on each side
            return side**3 * self.voxel_texels.num_bytes // 4
        has_channels = self.shading is not None or self.bricks.volume.colors is not None
        return PADDED_BRICK_SIZE**3 * (4 if has_channels else 1)


@dataclass(frozen=True)
class BrickLayers:
    """A list of layers on one grid of voxels.

    clip: the planes and boxes that clip all layers, besides the planes and boxes of the view.
    is_additive: whether nothing is absorbed, so that light only adds up.
    light: the light that the layers scatter; their colours are then linear albedos. None without such light.
    """

    layers: tuple[BrickLayer, ...]
    clip: tuple[ClipSpec, ...] = ()
    is_additive: bool = False
    light: SceneLight | None = None

    @property
    def volume(self) -> Volume:
        """Return the volume of the first layer. The volumes of all layers have the same grid."""
        return self.layers[0].bricks.volume

    @cached_property
    def levels(self) -> tuple[BrickLevel, ...]:
        """Return the levels of bricks, from 0 on, in which the bricks of all layers are joined."""
        first = self.layers[0]
        if len(self.layers) == 1 and first.weight == 1.0:
            return first.bricks.levels
        by_level = zip(*(layer.bricks.levels for layer in self.layers), strict=True)
        return tuple(_join_levels(levels, [layer.weight for layer in self.layers]) for levels in by_level)


def _join_levels(levels: tuple[BrickLevel, ...], weights: list[float]) -> BrickLevel:
    bounds = np.stack([level.visible_bounds for level in levels])
    is_visible = np.stack([level.is_visible for level in levels])[..., None]
    low = np.where(is_visible, bounds[..., 0, :], np.inf).min(axis=0)
    high = np.where(is_visible, bounds[..., 1, :], 0.0).max(axis=0)
    joined = np.stack([np.minimum(low, high), high], axis=-2).astype(np.float32)
    errors, step_errors = (
        np.sum([weight * array for weight, array in zip(weights, arrays, strict=True)], axis=0)
        for arrays in ([level.errors for level in levels], [level.step_errors for level in levels])
    )
    return BrickLevel(joined, errors, step_errors)
