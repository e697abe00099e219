"""Composite many layers of splats precisely: draw chunks in float32 without a background, and blend them in float64.

A layer is one of the splats over one another at a pixel. Blending `source + (1 - alpha) image` in float32 rounds the
factor, the product and the sum, each by at most u = 2^-24 of its size: an error of at most 3 u A for each layer, where
A is the final alpha. The splat's own alpha has about the same error. The errors of a million equal thin layers add up
to 2e-3. The chunks in front of a chunk attenuate its error as they attenuate its alpha, and the attenuated alphas add
up to A. With at most B layers of each chunk at a pixel, the error is below 6 u B A, for any number of chunks.

The mean number of layers over the pixels that splats may cover is known before anything is drawn, and it is bounded: a
chunk has a mean of MEAN_LAYERS layers, or MIN_CHUNK_SPLATS splats if that is more. Where visible cells are concentrated
a pixel may have more layers than the mean; then B is their number. Each chunk waits for the device once. Ordinary
frames have a lower mean and are drawn as one chunk.

The largest measured errors of a channel, of colours from 0 to 1:

- a CT scan of an engine, voxel by voxel (1.2 million splats, a mean of 102 layers, one chunk): 1.4e-6;
- the same scan from far away (a mean of 3554 layers): 3e-6 in 14 chunks, and 6e-5 in one chunk;
- a million equal layers on the only pixel of a picture: 4e-5;
- a million equal layers on one pixel, if 512 x 512 pixels count as covered: 7e-3.
"""

from __future__ import annotations

# A chunk of splats covers a pixel with this many layers in the mean. The rounding error of a channel is then below 9e-5
# (6 u B, see the module's text), a fortieth of an 8-bit step, even if all roundings have one sign.
MEAN_LAYERS = 256

# A chunk has at least this many splats: with smaller ones, more time is lost in waiting for the device. If all splats
# of a chunk are on one pixel, the rounding error of a channel is below 1.5e-3; equal thin layers reach 1e-4.
MIN_CHUNK_SPLATS = 1 << 12


def splats_per_chunk(num_pixels: int, footprint_area_px: float) -> int:
    """Return the number of splats in a chunk.

    num_pixels: the pixels that splats may cover. footprint_area_px: the pixels that one splat covers, in the mean.
    """
    return max(MIN_CHUNK_SPLATS, int(MEAN_LAYERS * num_pixels / footprint_area_px))
