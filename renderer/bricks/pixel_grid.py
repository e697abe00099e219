"""Choose the lattice of rays at a tolerance: strides of subsampled pixel grids, rays of a pixel, and where rays end.

The lattices are one ladder, from every eighth pixel to a quarter of a pixel:

    8, 4, 2      pixels from one ray to the next; pixels between are interpolated where the picture is even
    1            one ray through the centre of each pixel
    1/2, 1/4     4 and 16 rays in the pixels where the picture is uneven; a pixel is the mean of its rays
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from renderer.volume import Float64, Int64

# The tolerance from which on a subsampled pixel grid is used, the stride that the cells must allow, and the strides.
# Every pixel is drawn at smaller tolerances. Decision 025 has what was measured.
STRIDES = ((2.0, 8, (8, 4)), (1.0, 4, (4, 2)), (0.6, 4, (4, 1)), (0.15, 4, (2, 1)))
# The largest distance between two nodes of a subsampled pixel grid, in widths of the finest drawn cells, for each
# STRIDE_TOLERANCE_UNIT of the tolerance: four cells at 0.3. Thinner structures may fall between the nodes, such as a
# sheet seen edge-on, or the part of a cell that a steep transfer function shows.
MAX_STRIDE_CELLS = 1.35
# The tolerance at which nodes may be MAX_STRIDE_CELLS cells apart.
STRIDE_TOLERANCE_UNIT = 0.1
# The largest distance between two nodes of a subsampled pixel grid, as a share of the volume's thinnest side.
MAX_STRIDE_THICKNESS = 0.5
# The difference between nodes up to which the pixels between them are interpolated, in tolerances.
DIFFERENCE_THRESHOLD = 0.35
# The largest difference, of colours from 0 to 1, up to which pixels are interpolated, however coarse the tolerance is.
MAX_DIFFERENCE_THRESHOLD = 0.35
# The transmittance at which a ray ends, in tolerances. With 0.08 instead of 0.04, two CT scans lose 1 to 1.5 dB, with
# 0.15 another 3 to 5 dB, and gain 2 to 4 % of the time.
TERMINATION_TRANSMITTANCE = 0.04
# The largest transmittance at which a ray ends, however coarse the tolerance is.
MAX_TERMINATION_TRANSMITTANCE = 0.025

# The numbers of rays along each row and column of a pixel: the first if the pixel differs from a neighbour, the
# second if the rays of the first number differ.
RAYS_ACROSS = (2, 4)
# The difference between a pixel and a neighbour up to which one ray is enough, in tolerances. At 512 x 512 and
# tolerance 0.1, 1.5 gives 53.1, 52.4 and 53.2 dB (engine, bonsai, labels) of the mean over the pixel in 1.5, 2.0 and
# 1.8 of the time of one ray; 3 gives 51.5, 48.0 and 51.0 dB in 1.3, 1.4 and 1.6. With 1.5 a larger tolerance is as
# exact in less time.
CONTRAST_THRESHOLD = 1.5
# The difference between the four rays of a pixel up to which they are enough, in tolerances. 16 rays cost as much as
# four pixels of 4, so that a larger difference than between pixels is worth them.
SPREAD_THRESHOLD = 4.0

# The distance, along x and y in units of 2^-32 pixels, by which the ray of a scattered pixel moves from one column to
# the next (first row), and from one row to the next (second row).
SCATTER = np.array([[1779033703, 1013904243], [3144134277, 2773480762]])
# The width of the finest cells, in pixels, from which on no pixel is scouted: thinner structures than a pixel need
# smaller cells than a pixel.
MAX_SCOUTED_CELL_PX = 1.0
# Pixels are scouted at tolerances below this. At 256 x 256 and tolerances from 0.15 to 0.9, scouts add at most 0.08 dB
# (engine, bonsai, vessels), and take 1.2 to 2.4 times the time of an engine without them.
MAX_SCOUTED_TOLERANCE = 0.15
# The least contrast that counts: half a level of 8 bits.
MIN_CONTRAST_THRESHOLD = 0.5 / 255
# float32 does not resolve a smaller transmittance.
_MIN_TERMINATION_TRANSMITTANCE = 2.0**-22


@dataclass(frozen=True)
class ScreenSampling:
    """A choice of the pixels of a picture that are drawn, and of where rays end.

    strides: falling, of the subsampled pixel grids. The first grid draws one of `stride` pixels along both axes. Each
        later grid draws only the blocks between four nodes of the grid before whose nodes differ. The other blocks are
        interpolated (bilinear), as are pixels between the nodes of the last grid. (1,) draws every pixel.
    difference_threshold: four nodes differ where a channel (premultiplied RGBA) differs by more than this among them
        and a channel bends by more than this at one of them, along rows or columns: by `|a - 2 b + c|`, with b the node
        and a and c its neighbours on the grid, at the edge the node itself.
    termination_transmittance: rays end at a smaller transmittance.
    contrast_threshold: pixels that differ in a channel by more than this from one of their eight neighbours get four
        rays, if every pixel is drawn.
    spread_threshold: pixels whose four rays differ in a channel by more than this get 16.
    is_scouted: whether every other pixel has one more ray somewhere in it, which finds lines between the rays. Pixels
        that differ from it by more than `contrast_threshold` get 16 rays.
    """

    strides: tuple[int, ...]
    difference_threshold: float
    termination_transmittance: float
    contrast_threshold: float = math.inf
    spread_threshold: float = math.inf
    is_scouted: bool = False

    @property
    def termination_alpha(self) -> float:
        """Return the alpha at which a ray may end: nothing behind it is drawn, or float32 would lose it."""
        return 1 - max(self.termination_transmittance, _MIN_TERMINATION_TRANSMITTANCE)


def screen_sampling_at(tolerance: float, cell_px: float, thinnest_px: float = math.inf) -> ScreenSampling:
    """Return the screen sampling at a tolerance.

    cell_px, thinnest_px: widths in pixels of the finest cells, and of the volume's thinnest side.
    """
    most = min(MAX_STRIDE_CELLS * cell_px * tolerance / STRIDE_TOLERANCE_UNIT, MAX_STRIDE_THICKNESS * thinnest_px)
    strides = next((wanted for least, widest, wanted in STRIDES if tolerance >= least and widest <= most), (1,))
    threshold = min(DIFFERENCE_THRESHOLD * tolerance, MAX_DIFFERENCE_THRESHOLD) if len(strides) > 1 else 0.0
    # Cells smaller than a pixel differ more inside of it than pixels tell.
    contrast = max(CONTRAST_THRESHOLD * tolerance * min(cell_px, 1.0), MIN_CONTRAST_THRESHOLD)
    return ScreenSampling(
        strides,
        threshold,
        min(TERMINATION_TRANSMITTANCE * tolerance, MAX_TERMINATION_TRANSMITTANCE),
        contrast,
        contrast * SPREAD_THRESHOLD / CONTRAST_THRESHOLD,
        cell_px < MAX_SCOUTED_CELL_PX and tolerance < MAX_SCOUTED_TOLERANCE,
    )


def ray_positions(pixels: Int64, width: int, across: int, *, is_scattered: bool = False) -> Float64:
    """Return where the rays of pixels are in a picture, in pixels from its top left corner: float64 [n * across^2, 2].

    pixels: numbers, row by row, of a picture with this width. The rays of a pixel are a sheared grid, as in `rays.h`.
    is_scattered: whether the only ray of a pixel is somewhere in it, and not in its middle.
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
