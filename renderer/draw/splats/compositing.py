"""Composite many layers of splats precisely: draw chunks in float32 without a background, and blend them in float64.

Blending `source + (1 - alpha) image` in float32 (u = 2^-24) rounds the factor, the product and the sum: an error of at
most 3 u A for each layer, where A is the final alpha. The splat's own alpha has about the same error. A million equal
thin layers add up to 2e-3. The chunks in front of a chunk attenuate its error as they attenuate its alpha, and the
attenuated alphas add up to A. With at most B layers of each chunk at a pixel, the error is below 6 u B A, for any
number of chunks.

The mean number of layers over the pixels under the model is known before anything is drawn, and it is bounded: a chunk
has a mean of MEAN_LAYERS layers, or MIN_CHUNK_SPLATS splats if these are more. Where visible cells are concentrated a
pixel may have more layers than the mean; then B is their number. Each chunk waits for the device once. Ordinary frames
have a lower mean and are drawn as one chunk.

The largest measured errors of a channel are, for an engine voxel by voxel (1.2 million splats, a mean of 102 layers,
one chunk) 1.4e-6; from far away (a mean of 3554 layers) 3e-6 in 14 chunks, and 6e-5 in one chunk; a million equal
layers on the only pixel 4e-5; and on one pixel among 512 x 512 that count as covered 7e-3.
"""

from __future__ import annotations

# The mean number of layers of a chunk. With it, 6 u B is 9e-5, a fortieth of an 8-bit step, if all roundings have one
# sign.
MEAN_LAYERS = 256

# The least number of splats in a chunk: a smaller chunk loses more time waiting for the device than it gains. The bound
# of the rounding error (see the module's text) is 1.5e-3 if all splats are on one pixel; equal thin layers reach 1e-4.
MIN_CHUNK_SPLATS = 1 << 12


def splats_per_chunk(num_pixels: int, footprint_area_px: float) -> int:
    """Return the number of splats in a chunk, if each covers `footprint_area_px` of the `num_pixels` pixels."""
    return max(MIN_CHUNK_SPLATS, int(MEAN_LAYERS * num_pixels / footprint_area_px))
