"""Measure the lengths of rays inside the part of the volume's box that clipping leaves."""

from __future__ import annotations

import numpy as np

from renderer.bricks import ray_positions
from renderer.kernels import ThreadPool, kernels
from renderer.scene import ClipSpec
from renderer.view import View, ray_setup
from renderer.volume import Float32, Float64, Volume


def chord_lengths(
    volume: Volume, view: View, clip: tuple[ClipSpec, ...], positions_px: Float64 | None, threads: ThreadPool
) -> Float32:
    """Return the world lengths of rays inside the volume's box, beyond the near plane: float32 [n], or [h, w].

    Parts of a ray that clipping removes, and parts in voxels without data, do not count.
    clip: planes and boxes that clip the volume, in addition to those of the view.
    positions_px: float64 [n, 2], the positions of rays in the picture, in pixels; None for the centres of all pixels of
        the picture, [h, w].
    """
    measure = kernels().measure_chords.partial(
        rays=ray_setup(volume, volume.half_diagonal, view, clip), shape=volume.shape_xyz, unit=volume.half_diagonal,
        absent=volume.are_absent if volume.num_absent else None,
    )  # fmt: skip
    if positions_px is not None:
        lengths = np.empty(len(positions_px), np.float32)
        measure(positions_px=positions_px, lengths=lengths)
        return lengths
    width, height = view.size
    of_pixels = np.empty((height, width), np.float32)

    def measure_rows(first: int, end: int) -> None:
        centres = ray_positions(np.arange(first * width, end * width), width, 1)
        measure(positions_px=centres, lengths=of_pixels[first:end].reshape(-1))

    threads.for_rows(measure_rows, of_pixels)
    return of_pixels
