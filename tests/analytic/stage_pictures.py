"""A frame of a stage, as the processor draws it, as exact rays see it, and as the mean over each pixel's area."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from renderer.accuracy import FrameProber, psnr
from renderer.bricks import ScreenSampling
from renderer.draw import BrickRasterizer
from renderer.film import quantize
from renderer.frame import Stage, Stopwatch, draw_frame, make_draw_list, make_primitive, render_frames, view_of
from renderer.system import MemoryShare
from renderer.truth import SceneRays, pixel_centres
from renderer.volume import Float32, Float64

NUMBER = 3  # of the frame; no axis of the volume is along the view
NUM_PROBES = 1024  # pixels whose means are compared


def drawn(stage: Stage, number: int = NUMBER, *, num_threads: int = 2, memory: MemoryShare | None = None) -> Float32:
    """Return the radiance [h, w, 4]."""
    with BrickRasterizer(num_threads=num_threads, memory=memory) as rasterizer:
        (frame,) = render_frames(stage, [number], rasterizer, clock=lambda: 0.0)
    return frame.radiance


def drawn_by_single_rays(stage: Stage) -> Float32:
    """Return the radiance [h, w, 4] of frame NUMBER by one ray through the centre of each pixel.

    Against `exact` it tells how exact rays are, whatever pixels make of them.
    """
    lod = make_primitive(stage).make_lod(stage.scene.error.tolerance, lambda _: None)
    lod = replace(lod, batches=[replace(each, screen_sampling=_single(each.screen_sampling)) for each in lod.batches])
    watch = Stopwatch(lambda: 0.0)
    with BrickRasterizer(num_threads=2) as rasterizer:
        return draw_frame(make_draw_list(stage, lod, NUMBER, watch), rasterizer, watch).radiance


def _single(sampling: ScreenSampling) -> ScreenSampling:
    return replace(sampling, contrast_threshold=math.inf, spread_threshold=math.inf, is_scouted=False)


def exact(stage: Stage, step: float = 0.5) -> Float64:
    """Return the radiance [h, w, 4] of frame NUMBER, by exact rays through pixel centres in steps of so many voxels."""
    width, height = stage.scene.output.size
    rays = SceneRays(stage, num_threads=2).integrate(view_of(stage, NUMBER), pixel_centres((width, height)), step)
    return rays.reshape(height, width, 4)


def decibels(one: npt.ArrayLike, other: npt.ArrayLike) -> float:
    """Return the peak signal-to-noise ratio of two pictures, 300 of equal ones."""
    return float(-10 * np.log10(np.mean(np.subtract(one, other) ** 2) + 1e-30))


def decibels_of_means(stage: Stage) -> float:
    """Return the peak signal-to-noise ratio of frame NUMBER as it is drawn, against means over the area of pixels.

    It is an estimate by NUM_PROBES pixels, the same at each run; infinity if they find no error.
    """
    radiance = drawn(stage)
    image = quantize(radiance, stage.scene.background)
    exact = FrameProber(stage, NUM_PROBES, num_threads=2).exact_pixels(NUMBER, image)
    return psnr(exact.compare_radiance(radiance).samples.mean)
