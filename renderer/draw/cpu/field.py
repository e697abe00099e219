"""Describe the field that samples are taken of, for `sample.h`."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.bricks import BrickBatch
from renderer.scene import ShadingSpec
from renderer.transfer import PiecewiseTransfer, toward_light
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
        "lowest_visible": lowest_visible(batch.bricks.pieces),
        "termination_alpha": batch.screen_sampling.termination_alpha,
        "spacings_per_model_unit": np.float32(batch.spacings_per_model_unit),
        "has_absent": batch.cut.volume.num_absent > 0,
        "is_lit": batch.shading is not None and batch.shading.is_plain,
        "lambert": (*toward_light(shading).tolist(), shading.ambient, shading.diffuse),
    }


def lowest_visible(transfer: PiecewiseTransfer) -> np.float32:
    """Return a scalar below which no extinction is positive.

    That is the start of the first piece with a positive extinction. Where extinction is 0 at the origin of a piece, and
    its slope is not positive, no scalar above the origin has a positive one; rounding keeps this. Only the piece in
    which the search starts has scalars below its origin.
    """
    first = transfer.guide[0]
    tau, slope = transfer.rows[first:, 2], transfer.rows[first:, 3]
    is_visible = (tau > 0) | (slope > 0)
    is_visible[0] |= slope[0] < 0
    starts = np.append(np.float32(-np.inf), transfer.rows[first:-1, 0])
    lowest: np.float32 = starts[is_visible].min(initial=np.float32(np.inf))
    return lowest
