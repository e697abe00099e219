"""Choose the rays of a picture at a tolerance: the pixels that are drawn, the rays of a pixel, and where rays end.

The distance between rays, in pixels, has one of these values:

    8, 4, 2      pixels between rays are interpolated where the picture is smooth
    1            one ray passes through the centre of each pixel
    1/2, 1/4     pixels where the picture is not smooth get 4 or 16 rays; a pixel is the mean of its rays
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from renderer.volume import Float64, Int64

# Rows of the tolerance from which on strides are used, the distance between drawn pixels that the cells must allow, and
# the strides of the subsampled pixel grids, from coarse to fine. The first row that fits is taken; if none does, every
# pixel is drawn. With a stride of 4 first below 0.6, pictures lose 0.3 to 4 dB. With a stride of 2 below 0.15, thin
# wires look dashed, and a chest takes 1.2 times the time.
STRIDES = ((2.0, 8, (8, 4)), (1.0, 4, (4, 2)), (0.6, 4, (4, 1)), (0.15, 4, (2, 1)))
# The largest distance between two nodes (drawn pixels) of a subsampled pixel grid at the tolerance
# STRIDE_TOLERANCE_UNIT, in widths of the finest drawn cells. It grows in proportion to the tolerance: four cells at
# 0.3. Thinner structures may fall between the nodes, such as a sheet of matter seen edge-on, or the part of a cell that
# a steep transfer function shows.
MAX_STRIDE_CELLS = 1.35
# The tolerance at which nodes of a subsampled pixel grid may be MAX_STRIDE_CELLS cells apart.
STRIDE_TOLERANCE_UNIT = 0.1
# The largest distance between two nodes of a subsampled pixel grid, as a share of the volume's thinnest side.
MAX_STRIDE_THICKNESS = 0.5
# Pixels between nodes of a subsampled pixel grid are interpolated if the nodes' colours, from 0 to 1, differ by at most
# this times the tolerance. With 1, pictures take half of the time, but a chest loses 10 dB.
DIFFERENCE_THRESHOLD = 0.35
# The largest difference, of colours from 0 to 1, up to which pixels are interpolated, however coarse the tolerance is.
MAX_DIFFERENCE_THRESHOLD = 0.35
# A ray ends if its transmittance is below this times the tolerance. With 0.08 instead of 0.04, the pictures of two CT
# scans lose 1 to 1.5 dB; with 0.15 they lose another 3 to 5 dB, and 2 to 4 % of the time are saved.
TERMINATION_TRANSMITTANCE = 0.04
# The largest transmittance at which a ray ends, however coarse the tolerance is.
MAX_TERMINATION_TRANSMITTANCE = 0.025

# The number of rays along each side of a pixel that needs several: 2 if the pixel differs from a neighbour, 4 if its 2
# x 2 rays differ.
RAYS_ACROSS = (2, 4)
# One ray is enough for a pixel if its colour, from 0 to 1, differs from each neighbour by at most this times the
# tolerance. At 512 x 512 and tolerance 0.1, 1.5 gives 53.1, 52.1 and 52.3 dB (engine, bonsai, labels) against exact
# means over pixels, in 1.2, 1.6 and 1.5 times the time of one ray a pixel; 2 gives 52.7, 50.3 and 52.0 dB in 1.1, 1.5
# and 1.4 times. A film with 1.5 and a larger tolerance is as exact in less time.
CONTRAST_THRESHOLD = 1.5
# Four rays are enough for a pixel if their colours, from 0 to 1, differ by at most this times the tolerance. 16 rays in
# one pixel cost as much as 4 rays in four pixels, so that this threshold is higher than CONTRAST_THRESHOLD. With 4, the
# pictures above have 0.1, 0.0 and 1.2 dB more, and take 1.3, 1.95 and 1.55 times the time.
SPREAD_THRESHOLD = 6.0

# The change of a scattered ray's x and y in its pixel from one column to the next (first row), and from one row to the
# next (second row), in units of 2^-32 pixels.
SCATTER = np.array([[1779033703, 1013904243], [3144134277, 2773480762]])
# If the finest cells are at least this wide, in pixels, no pixel gets the additional scattered ray: structures thinner
# than a pixel need cells smaller than a pixel.
MAX_SCOUTED_CELL_PX = 1.0
# No pixel gets the additional scattered ray from this tolerance on. At 256 x 256 and tolerances from 0.15 to 0.9, these
# rays add at most 0.08 dB (engine, bonsai, vessels), and the engine takes 1.2 to 2.4 times the time without them.
MAX_SCOUTED_TOLERANCE = 0.15
# A larger tolerance has the thresholds of this one, which are still numbers of float32.
_MAX_TOLERANCE = 1e30
# The smallest threshold for differences between pixels, however fine the tolerance is: half a level of 8 bits, of
# colours from 0 to 1.
MIN_CONTRAST_THRESHOLD = 0.5 / 255
# The smallest transmittance at which a ray ends, however fine the tolerance is: float32 does not resolve smaller ones.
_MIN_TERMINATION_TRANSMITTANCE = 2.0**-22


@dataclass(frozen=True)
class ScreenSampling:
    """A choice of the pixels of a picture that are drawn, of their rays, and of where rays end.

    strides: the falling distances, in pixels, between the nodes (drawn pixels) of a sequence of pixel grids. The first
        grid draws all of its nodes. Each later grid draws its nodes only between four nodes of the grid before that
        differ, and interpolates the others bilinearly; so are pixels between the nodes of the last grid. (1,) draws
        every pixel.
    difference_threshold: four nodes differ if a channel (premultiplied RGBA) varies by more than this among them, and a
        channel bends by more than this at one of them, along a row or column: by `|a - 2 b + c|`, with b the node and a
        and c its neighbours on the grid. Beyond the border of the picture, the node is its own neighbour.
    termination_transmittance: rays end when their transmittance is below this.
    contrast_threshold: if every pixel is drawn, a pixel gets four rays if a channel differs by more than this from one
        of the pixel's eight neighbours.
    spread_threshold: a pixel gets 16 rays if a channel varies by more than this among its four rays.
    is_scouted: whether every third pixel gets one more ray somewhere in it, which finds thin lines between the first
        rays. If it differs from the first ray by more than `contrast_threshold`, the pixel gets 16 rays.
    """

    strides: tuple[int, ...]
    difference_threshold: float
    termination_transmittance: float
    contrast_threshold: float = math.inf
    spread_threshold: float = math.inf
    is_scouted: bool = False

    @property
    def termination_alpha(self) -> float:
        """Return the alpha beyond which a ray ends. It is below 1 even in float32."""
        return 1 - max(self.termination_transmittance, _MIN_TERMINATION_TRANSMITTANCE)


def screen_sampling_at(tolerance: float, cell_px: float, thinnest_px: float = math.inf) -> ScreenSampling:
    """Return the screen sampling at a tolerance.

    cell_px: the width of the finest cells, in pixels. thinnest_px: the length of the volume's thinnest side, in pixels.
    """
    most = min(MAX_STRIDE_CELLS * cell_px * tolerance / STRIDE_TOLERANCE_UNIT, MAX_STRIDE_THICKNESS * thinnest_px)
    strides = next((wanted for least, widest, wanted in STRIDES if tolerance >= least and widest <= most), (1,))
    threshold = min(DIFFERENCE_THRESHOLD * tolerance, MAX_DIFFERENCE_THRESHOLD) if len(strides) > 1 else 0.0
    # With cells smaller than a pixel, colours vary more inside of a pixel than between pixels. In proportion to the
    # cells, the threshold would give 2 to 6 dB more at 64 x 64 pixels, in 1.0 to 1.8 times the time.
    detail = math.sqrt(min(cell_px, 1.0))
    contrast = max(CONTRAST_THRESHOLD * min(tolerance, _MAX_TOLERANCE) * detail, MIN_CONTRAST_THRESHOLD)
    return ScreenSampling(
        strides,
        threshold,
        min(TERMINATION_TRANSMITTANCE * tolerance, MAX_TERMINATION_TRANSMITTANCE),
        contrast,
        contrast * SPREAD_THRESHOLD / CONTRAST_THRESHOLD,
        cell_px < MAX_SCOUTED_CELL_PX and tolerance < MAX_SCOUTED_TOLERANCE,
    )


def ray_positions(pixels: Int64, width: int, across: int, *, is_scattered: bool = False) -> Float64:
    """Return the positions of rays in a picture, in pixels from its top left corner: float64 [n * across^2, 2].

    pixels: int64 [n], the numbers of pixels, row by row, in a picture of this width. across: the number of rays along
    each side of a pixel, which form a small sheared grid, as in `rays.h`.
    is_scattered: whether the only ray of a pixel passes through a random place in it, and not through its middle.
    """
    row, column = np.divmod(pixels, width)
    below, beside = np.divmod(np.arange(across**2), across)
    centres = (np.stack([beside, below], axis=1) + 0.5) / across
    shear = (centres[:, ::-1] - 0.5) / across * (1.0, -1.0)
    positions = np.stack([column, row], axis=1)[:, None] + centres + shear
    if is_scattered:
        whole = np.stack([column, row], axis=1) @ SCATTER & 0xFFFFFFFF
        positions += ((whole >> 8) / 2.0**24 - 0.5)[:, None]
    return np.asarray(positions.reshape(-1, 2), np.float64)
