"""Constants of the rasterisers. Shaders use them by name: `renderer.draw.gl.programs` writes them there."""

from __future__ import annotations

from renderer.bricks import BRICK_SIZE

# 1 - exp(-x) below x = 1/2, where the difference would cancel, is x (1 - x (a - x (b - x (c - x d)))): the polynomial
# with 1 at 0 whose largest relative error is least (9e-8, by linear programming).
OPACITY_SERIES = 0.49999463, 0.16656359, 0.04104245, 0.00680757

# Samples of a ray in a brick; only rays that rounding moves beyond their brick would have more.
MAX_SAMPLES = 4095
# Bounds of samples along an axis of a brick, in cells: between the centres of its first and last texel, because the
# texels beyond are another brick's. The rounding of rays in extremely wide views is larger.
MIN_SAMPLE_CELL, MAX_SAMPLE_CELL = -0.25, BRICK_SIZE + 0.25

# The rounding of a rectangle's edges in float32 on an image 16384 pixels wide.
RECTANGLE_ROUNDING_PX = 2e-3

# The uniform block of shapes holds 48 bytes for each; GL guarantees 16 KiB.
MAX_SHAPES = 256
# The sides of 3D textures are powers of two up to this.
MAX_ATLAS_SIDE = 2048
# Pieces of the transfer function in a row of their texture.
PIECES_IN_ROW = 1024
# Stands for infinity where float32 is needed.
LARGE_FLOAT32 = 1e30
