"""Measure how long rays are inside what is left of the volume's box."""

from __future__ import annotations

import numpy as np

from renderer.kernels import ThreadPool, kernels
from renderer.view import View, ray_setup
from renderer.volume import Float32, Volume

_MIN_PIXELS_PER_THREAD = 1 << 15


def chord_lengths(volume: Volume, view: View, threads: ThreadPool) -> Float32:
    """Return the world length of each pixel's ray inside the box, beyond the near plane, less cuts: float32 [h, w].

    Voxels without data do not count.
    """
    width, height = view.size
    lengths = np.empty((height, width), np.float32)
    measure = kernels().measure_chords.partial(
        rays=ray_setup(volume, volume.half_diagonal, view), shape=volume.shape_xyz, unit=volume.half_diagonal,
        absent=volume.are_absent if volume.num_absent else None,
    )  # fmt: skip

    def work(first: int, end: int) -> None:
        measure(first_row=first, lengths=lengths[first:end])

    threads.for_ranges(work, *rows_per_thread(lengths))
    return lengths


def rows_per_thread(pixels: Float32) -> tuple[int, int]:
    """Return the number of rows of pixels [h, w], and how many of them are worth a thread."""
    height, width = pixels.shape
    return height, -(-_MIN_PIXELS_PER_THREAD // width)
