"""Measure the lengths of rays inside the part of the volume's box that clipping leaves."""

from __future__ import annotations

import numpy as np

from renderer.kernels import ThreadPool, kernels
from renderer.scene import ClipSpec
from renderer.view import View, ray_setup
from renderer.volume import Float32, Volume


def chord_lengths(volume: Volume, view: View, clip: tuple[ClipSpec, ...], threads: ThreadPool) -> Float32:
    """Return the world length of each pixel's ray inside the box, beyond the near plane: float32 [h, w].

    clip: clip planes and boxes besides those of the view. Parts of rays that are clipped away, or in voxels without
    data, do not count.
    """
    width, height = view.size
    lengths = np.empty((height, width), np.float32)
    measure = kernels().measure_chords.partial(
        rays=ray_setup(volume, volume.half_diagonal, view, clip), shape=volume.shape_xyz, unit=volume.half_diagonal,
        absent=volume.are_absent if volume.num_absent else None,
    )  # fmt: skip
    threads.for_rows(lambda first, end: measure(first_row=first, lengths=lengths[first:end]), lengths)
    return lengths
