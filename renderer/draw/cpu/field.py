"""Describe the field that samples are taken of, for `sample.h`."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.bricks import BrickBatch
from renderer.scene import ShadingSpec
from renderer.transfer import toward_light
from renderer.volume import Float32


def field_of(batch: BrickBatch, scalars: Float32, means: Float32) -> dict[str, Any]:
    """Return the field of a batch: the texels of all bricks, in two atlases, and the table that classifies them.

    They are members of DrawTiles in kernels.h.
    scalars: of each brick [PADDED_BRICK_SIZE^3]; with shading, the gradients [PADDED_BRICK_SIZE^3, 3] follow.
    means: of each brick [PADDED_BRICK_SIZE^3, 4].
    termination_alpha, spacings_per_model_unit: as in ScreenSampling and BrickBatch.
    has_absent: whether any voxel has no data.
    lambert: unit vector to the light (x, y, z), ambient and diffuse; used if `is_lit`.
    """
    shading = batch.shading if batch.shading and batch.shading.is_plain else ShadingSpec()
    return {
        "scalars": scalars,
        "means": means,
        "pieces": batch.bricks.pieces,
        "termination_alpha": batch.screen_sampling.termination_alpha,
        "spacings_per_model_unit": np.float32(batch.spacings_per_model_unit),
        "has_absent": batch.cut.volume.num_absent > 0,
        "is_lit": batch.shading is not None and batch.shading.is_plain,
        "lambert": (*toward_light(shading).tolist(), shading.ambient, shading.diffuse),
    }
