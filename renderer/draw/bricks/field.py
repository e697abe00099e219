"""Describe the field of a layer from which kernels take samples, for `sample.h`."""

from __future__ import annotations

import numpy as np

from renderer.bricks import BrickLayer
from renderer.draw.bricks.brick_cache import BrickView
from renderer.draw.bricks.light import make_light
from renderer.kernels import AtlasTexels, Field, FieldMask
from renderer.scene import ShadingSpec
from renderer.transfer import toward_light
from renderer.volume import Float32


def field_of(layer: BrickLayer, voxels: AtlasTexels, means: Float32, brick_view: BrickView) -> Field:
    """Return the field of a layer: the texels of all bricks, in two atlases, and the table that classifies them.

    voxels, means: the texels of the two atlases, as in the record Field of kernels.
    """
    shading = layer.shading if layer.shading and layer.shading.is_plain else ShadingSpec()
    return Field(
        voxels=voxels,
        means=means,
        pieces=layer.bricks.pieces,
        weight=layer.weight,
        lambert=np.array([*toward_light(shading), shading.ambient, shading.diffuse]),
        has_absent=layer.bricks.volume.num_absent > 0,
        is_labels=layer.bricks.volume.is_labels,
        has_colors=layer.bricks.volume.colors is not None,
        is_lit=layer.shading is not None and layer.shading.is_plain,
        lights_faces=layer.lights_faces,
        light=make_light(layer),
        mask=_mask_of(layer, brick_view),
    )


def _mask_of(layer: BrickLayer, brick_view: BrickView) -> FieldMask | None:
    """Return the mask of a layer, and which bricks of the view its border passes through; None without a mask."""
    volume, are_cut = layer.bricks.volume, layer.bricks.are_cut
    if volume.mask_grid is None or are_cut is None:
        return None
    from_index, found = volume.mask_grid.from_index.copy(), np.zeros(len(brick_view.order), np.bool_)
    from_index[:, 3] += from_index[:, :3] @ volume.centre_index
    x, y, z = brick_view.batch.cut.cells[brick_view.order[~brick_view.is_mean]].T
    found[~brick_view.is_mean] = are_cut[z, y, x]
    return FieldMask(volume.mask_grid._replace(from_index=from_index), found)
