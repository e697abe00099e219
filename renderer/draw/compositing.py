"""Long stacks of splats in float32: drawn in chunks, each over nothing, and the chunks composited in float64.

Blending `source + (1 - alpha) image` in float32 (u = 2^-24) rounds the factor, the product and the sum, which is an
error of at most 3 u A a layer, A being the alpha reached; the splat's own alpha has about as much. A million equal thin
layers add up to 2e-3. A chunk's error is seen through what lies in front of it, and the chunks' alphas times what they
are seen through add up to A: with at most B layers of a chunk at a pixel the whole is right within 6 u B A, however
many chunks there are.

What is bounded is the mean of the layers over the pixels under the model, for it is known before anything is drawn: a
chunk has MEAN_LAYERS of them, or MIN_CHUNK_SPLATS splats if that is more. A pixel may have more than the mean, where
what is visible is concentrated; then B is what it has. Chunks cost a wait for the device each, and ordinary frames,
whose mean is lower, are drawn in one go.

Measured, largest error of a channel: voxel by voxel an engine of 1.2 million splats, 102 layers in the mean and one
chunk, 1.4e-6; from so far that the mean is 3554, in 14 chunks, 3e-6, and 6e-5 in one go; a million equal layers that
are all there is, on one pixel, 4e-5; on one pixel in the middle of 512 x 512 that count as covered, 7e-3.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.jit import jit

Float64 = npt.NDArray[np.float64]

# Layers of a chunk in the mean: 6 u B is 9e-5 for as many, a fortieth of the step of 8 bits, if every rounding went the
# same way.
MEAN_LAYERS = 256

# Splats in a chunk at least: fewer would cost more in waiting for the device than they gain. 6 u B is 1.5e-3 for as
# many on one pixel; equal thin layers reach 1e-4.
MIN_CHUNK_SPLATS = 1 << 12


def splats_per_chunk(num_pixels: int, footprint_area_px: float) -> int:
    """How many splats to draw into one chunk of so many pixels, if a footprint covers `footprint_area_px` of them."""
    return max(MIN_CHUNK_SPLATS, int(MEAN_LAYERS * num_pixels / footprint_area_px))


@jit
def composite_over(chunk: npt.NDArray[np.float32], image: Float64) -> None:
    """Lay a chunk over the image in place: both [h, w, 4], premultiplied RGBA."""
    for row in range(chunk.shape[0]):
        for column in range(chunk.shape[1]):
            transmittance = 1.0 - chunk[row, column, 3]
            for channel in range(4):
                image[row, column, channel] = chunk[row, column, channel] + transmittance * image[row, column, channel]
