"""A frame of a stage, as the processor draws it and as exact rays see it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from renderer.draw import BrickRasterizer
from renderer.frame import Stage, render_frames, view_of
from renderer.system import MemoryShare
from renderer.truth import SceneRays, pixel_centres
from renderer.volume import Float32, Float64

NUMBER = 3  # of the frame; no axis of the volume is along the view


def drawn(stage: Stage, number: int = NUMBER, *, num_threads: int = 2, memory: MemoryShare | None = None) -> Float32:
    """Return the radiance [h, w, 4]."""
    with BrickRasterizer(num_threads=num_threads, memory=memory) as rasterizer:
        (frame,) = render_frames(stage, [number], rasterizer, clock=lambda: 0.0)
    return frame.radiance


def exact(stage: Stage, step: float = 0.5) -> Float64:
    """Return the radiance [h, w, 4] of frame NUMBER, by exact rays through pixel centres in steps of so many voxels."""
    width, height = stage.scene.output.size
    rays = SceneRays(stage, num_threads=2).integrate(view_of(stage, NUMBER), pixel_centres((width, height)), step)
    return rays.reshape(height, width, 4)


def decibels(one: npt.ArrayLike, other: npt.ArrayLike) -> float:
    """Return the peak signal-to-noise ratio of two pictures, 300 of equal ones."""
    return float(-10 * np.log10(np.mean(np.subtract(one, other) ** 2) + 1e-30))
