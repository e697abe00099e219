"""Makes small pictures, and pictures of differences, for a report."""

from __future__ import annotations

import numpy as np

from renderer.accuracy import FloatImage
from renderer.film import rounded
from renderer.volume import UInt8

# Longest side of a thumbnail, in pixels.
THUMBNAIL_PX = 256
# Factor by which the differences from the truth are amplified.
DIFFERENCE_GAIN = 8.0


def thumbnail(picture: FloatImage) -> UInt8:
    """Average square blocks of a picture in [0, 1]; return uint8 [h, w, 3], at most THUMBNAIL_PX wide and high."""
    height, width = picture.shape[:2]
    block = -(-max(height, width) // THUMBNAIL_PX)
    padded = np.pad(picture, ((0, -height % block), (0, -width % block), (0, 0)), mode="edge")
    blocks = padded.reshape(padded.shape[0] // block, block, padded.shape[1] // block, block, 3)
    return rounded(blocks.mean(axis=(1, 3)))


def amplified_difference(picture: FloatImage, truth: FloatImage) -> FloatImage:
    """Return the absolute difference of a picture from the truth, times DIFFERENCE_GAIN, at most 1."""
    return np.minimum(np.abs(picture - truth) * DIFFERENCE_GAIN, 1.0)
