"""Describe the field that samples are taken of, for `sample.h`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.bricks import BrickBatch
from renderer.scene import ShadingSpec
from renderer.transfer import PiecewiseTransfer, toward_light
from renderer.volume import Float32


class Field(NamedTuple):
    """A field to sample: the texels of all bricks, and the table that classifies them.

    scalars: float32, of each brick [PADDED_BRICK_SIZE^3]; with shading, the gradients [PADDED_BRICK_SIZE^3, 3] follow.
    means: float32, of each brick [PADDED_BRICK_SIZE^3, 4].
    termination_alpha, spacings_per_model_unit: as in ScreenSampling and BrickBatch.
    has_absent: whether any voxel has no data.
    light: unit vector to the light (x, y, z), ambient and diffuse; used if `is_lit`.
    """

    scalars: Float32
    means: Float32
    pieces: PiecewiseTransfer
    termination_alpha: float
    spacings_per_model_unit: np.float32
    has_absent: bool
    is_lit: bool
    light: tuple[float, ...]


def make_field(batch: BrickBatch, scalars: Float32, means: Float32) -> Field:
    """Return the field of a batch, whose texels are in these two atlases."""
    shading = batch.shading if batch.shading and batch.shading.is_plain else ShadingSpec()
    return Field(
        scalars,
        means,
        batch.bricks.pieces,
        batch.screen_sampling.termination_alpha,
        np.float32(batch.spacings_per_model_unit),
        batch.cut.volume.num_absent > 0,
        batch.shading is not None and batch.shading.is_plain,
        (*toward_light(shading).tolist(), shading.ambient, shading.diffuse),
    )
