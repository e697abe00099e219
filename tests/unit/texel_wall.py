"""Pictures in which the ray of each pixel takes one sample, exactly at a texel, and so shows its colour."""

from __future__ import annotations

import numpy as np

from renderer.bricks import BRICK_SIZE, PADDED_BRICK_SIZE
from renderer.draw import RayGrid, make_grid
from renderer.kernels import AtlasTexels, Field, LayerBricks, Light, PiecewiseTransfer, RaySetup, kernels
from renderer.transfer import GUIDE_SIZE, PIECE_FLOATS
from renderer.volume import Array, Float32

_PER_BRICK = BRICK_SIZE**2
# Rays along z, one for each column of texels.
_ORIGINS, _DIRECTIONS = np.array([[0.0, 1, 0], [0, 0, 1], [0, 0, 0]]), np.array([[0.0, 0, 0], [0, 0, 0], [1, 0, 0]])
_RAYS = RaySetup(_ORIGINS, _DIRECTIONS, 0.0, 0.0, np.zeros(2), None)
# Extinction is the scalar.
LINEAR = PiecewiseTransfer(
    np.array([[np.inf, 0, 0, 1] + [0] * (PIECE_FLOATS - 4)], np.float32),
    np.zeros(GUIDE_SIZE, np.int32),
    -np.inf,
    np.zeros(GUIDE_SIZE + 1, np.float32),
)


def drawn(
    scalars: Array,
    pieces: PiecewiseTransfer = LINEAR,
    *,
    scale: float = 1.0,
    light: Light | None = None,
    gradients: Array | None = None,
) -> Float32:
    """Return the pixels [n, 4] of texels with these scalars [n] and gradients [n, 3].

    Rays go a way of 1 in each. scale: spacings in 1.
    """
    num = len(scalars)
    num_bricks = -(-num // _PER_BRICK)
    channels = np.zeros((num_bricks * _PER_BRICK, 4), np.float32)
    channels[:num, 0] = scalars
    if gradients is not None:
        channels[:num, 1:] = gradients
    texels = np.zeros((num_bricks, *[PADDED_BRICK_SIZE] * 3, 4), np.float32)
    texels[:, 1, 1:-1, 1:-1] = channels.reshape(num_bricks, BRICK_SIZE, BRICK_SIZE, 4)
    bricks = np.hstack([texels[..., 0].reshape(num_bricks, -1), texels[..., 1:].reshape(num_bricks, -1)])
    left, zero = np.arange(num_bricks) * float(BRICK_SIZE), np.zeros(num_bricks)
    right, size = left + BRICK_SIZE, zero + BRICK_SIZE
    boxes = np.column_stack([left, zero, zero, right, size, zero + 1, left, zero, zero, zero + 1, zero + 1e9])
    image = np.zeros((BRICK_SIZE, BRICK_SIZE * num_bricks, 4), np.float32)
    rectangles, offsets = np.column_stack([left, zero, right, size]), np.arange(num_bricks) * bricks.shape[1]
    grid = make_grid(rectangles, RayGrid(image.reshape(-1, 4), image.shape[:2]))
    field = Field(
        voxels=AtlasTexels(
            texels=np.append(bricks, np.zeros(2, np.float32)),
            offsets=offsets,
            rules=None,
            cells=np.zeros((num_bricks, 3), np.int32),
            free=np.empty(0, np.int64),
            num_taken=np.zeros(1, np.int64),
            are_met=np.zeros(num_bricks, np.bool_),
        ),
        means=np.empty(0, np.float32),
        pieces=pieces,
        weight=1.0,
        lambert=np.zeros(5),
        has_absent=False,
        is_labels=False,
        has_colors=False,
        is_lit=False,
        lights_faces=False,
        light=light,
        mask=None,
    )
    of_layer = LayerBricks(
        rays=_RAYS,
        spacings_per_model_unit=scale,
        boxes=boxes,
        is_mean=np.zeros(num_bricks, np.bool_),
        have_faces=np.zeros(num_bricks, np.bool_),
        face_depth=0.0,
        radiance=None,
        fog=None,
        fields=[field],
    )
    tiles = np.arange(len(grid.starts) - 1)
    kernels().draw_tiles(grid=grid, bricks=of_layer, termination_alpha=1.0, is_additive=False, tiles=tiles)
    return image.reshape(BRICK_SIZE, num_bricks, BRICK_SIZE, 4).swapaxes(0, 1).reshape(-1, 4)[:num]
