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

# An end of a line that is nearer to the eye plane is not divided by its depth.
MIN_LINE_DEPTH = 1e-5
# Where cells have a side of s model units and of p pixels, up to 2 / s of them lie behind one another, and the lines of
# one layer cover about 2 / p of the image: together they are a fog. Therefore a line's opacity is LINE_COVER * s * p,
# at most LINE_OPACITY, which bounds the total for cells of any size. Cells under MIN_SIDE_PX have no lines.
LINE_COVER, LINE_OPACITY, MIN_SIDE_PX = 0.75, 0.8, 3.0
# Colours of lines by level, the finest first, the last for all levels beyond: from orange to blue in even steps of
# lightness (CIE L* 62 to 41) and hue, as saturated as sRGB allows. The contrast to black and to white is at least 3
# (WCAG 2.2, 1.4.11, for graphics), except 2.97 of level 0 to white.
LEVEL_COLORS = tuple(
    tuple(channel / 255 for channel in bytes.fromhex(color))
    for color in ("ed730c", "f95b30", "fe414c", "fb2767", "f01483", "dc1e9f", "be33b8", "9446cd", "5354dc", "055ebf")
)
NUM_LEVEL_COLORS = len(LEVEL_COLORS)
