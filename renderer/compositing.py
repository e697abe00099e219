"""Long stacks of splats in float32: drawn in chunks, each over nothing, and the chunks composited in float64.

Blending `source + (1 - alpha) image` in float32 (u = 2^-24) rounds the factor, the product and the sum, which is an
error of at most 3 u A a layer, A being the alpha reached; the splat's own alpha has about as much. A million equal thin
layers add up to 2e-3. A chunk's error is seen through what lies in front of it, and the chunks' alphas times what they
are seen through add up to A: with at most B layers of a chunk at a pixel the whole is right within 6 u B A, however
many chunks there are. So B is bounded where many splats share few pixels; where they do not, a chunk holds as many
splats as there are pixels, which makes reading it back cheap beside drawing it.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.jit import jit

Float64 = npt.NDArray[np.float64]

# Splats in a chunk at least: fewer would cost more in waiting for the device than they gain. 6 u B is 1.5e-3 for as
# many on one pixel, if every rounding went the same way; equal thin layers, which come close to that, reach 1e-4.
LEAST_CHUNK = 1 << 12


def splats_at_once(num_pixels: int) -> int:
    """How many splats to draw into one chunk of so many pixels."""
    return max(LEAST_CHUNK, num_pixels)


@jit
def composite_over(chunk: npt.NDArray[np.float32], image: Float64) -> None:
    """Lay a chunk over the image in place: both [h, w, 4], premultiplied RGBA."""
    for row in range(chunk.shape[0]):
        for column in range(chunk.shape[1]):
            transmittance = 1.0 - chunk[row, column, 3]
            for channel in range(4):
                image[row, column, channel] = chunk[row, column, channel] + transmittance * image[row, column, channel]
