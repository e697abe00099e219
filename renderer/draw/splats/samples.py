"""Divide the samples of a picture into tiles, and average the samples of each pixel.

The samples form a lattice: a regular grid with one or several samples in each pixel. Tiles bound the memory that a
picture takes, and let a device draw a lattice that is larger than its largest texture.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from renderer.view import Region
from renderer.volume import Float32

# The largest side of a tile, in samples: such a tile takes 256 MiB on the device, and as much in memory. All splats are
# projected again for each tile, so that fewer tiles are faster.
LARGEST_TILE = 4096
# The least side of a tile, in samples. If a device has no room for such a tile, drawing fails.
SMALLEST_TILE = 256


class Tile(NamedTuple):
    """A tile of a lattice of samples.

    left, top: its first column and row in the lattice. part: the region of it that is drawn, counted from these.
    """

    left: int
    top: int
    part: Region


def tiles_over(region: Region, size: tuple[int, int]) -> Iterator[Tile]:
    """Yield the tiles that hold a region of a lattice. size: the width and height of a tile."""
    (width, height), right, bottom = size, region.left + region.width, region.top + region.height
    tops = range(region.top - region.top % height, bottom, height)
    lefts = range(region.left - region.left % width, right, width)
    for top, left in product(tops, lefts):
        column, row = max(region.left - left, 0), max(region.top - top, 0)
        end_column, end_row = min(right - left, width), min(bottom - top, height)
        yield Tile(left, top, Region(column, row, end_column - column, end_row - row))


def whole_pixels(region: Region, across: int) -> Region:
    """Return a region of a lattice of samples, enlarged to whole pixels. across: the samples along a pixel's side."""
    left, top = region.left // across * across, region.top // across * across
    right, bottom = -(-(region.left + region.width) // across), -(-(region.top + region.height) // across)
    return Region(left, top, right * across - left, bottom * across - top)


def average_samples(samples: Float32, across: int) -> Float32:
    """Return the mean of each pixel's samples: float32 [h, w, 4].

    samples: float32 [h * across, w * across, 4], premultiplied RGBA. They are limited to 1 first, as a display limits
    them; with one sample for each pixel, they are returned unchanged.
    """
    if across == 1:
        return samples
    shown = np.minimum(samples, np.float32(1))
    mean = np.zeros((samples.shape[0] // across, samples.shape[1] // across, 4), np.float32)
    for row, column in product(range(across), repeat=2):
        mean += shown[row::across, column::across]
    mean *= np.float32(1 / across**2)
    return mean
