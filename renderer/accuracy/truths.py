"""Compute the truth of a frame, and choose the frames that are worth comparing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from renderer.accuracy.decibels import psnr
from renderer.accuracy.flicker import PictureErrors
from renderer.accuracy.metrics import Accuracy, FloatImage, measure_accuracy, sampled_accuracy
from renderer.accuracy.prober import ExactPixels, FrameProber
from renderer.draw import Rasterizer
from renderer.frame import Clock, FilmStage, render_frames, view_of
from renderer.scene import CameraPath, KeyframePath
from renderer.truth import Convergence, PixelMeans, Progress, SceneRays, ignore, mean_over_pixels
from renderer.volume import Bools

T = TypeVar("T")

# The convergence of the rays of a truth in every channel. Errors of 119 dB were seen with it: a pixel's few rays leave
# far more.
TRUTH_TOLERANCE = 1e-4
# Exact rays of a frame without a whole truth: its PSNR is then known to about 1 dB.
NUM_SAMPLED_PIXELS = 1024


@dataclass(frozen=True)
class Truth:
    """A truth: what the pixels of one frame show, by converged rays.

    means: over each pixel, [h, w, 3]. on_volume: bool [h, w], where anything of the volume is visible.
    convergence: the changes as the step was halved. rays_per_pixel: on average.
    seconds: the time that it took, where somebody has timed it.
    """

    frame: int
    means: PixelMeans
    on_volume: Bools
    convergence: Convergence
    rays_per_pixel: float = 0.0
    seconds: float = 0.0

    @property
    def picture(self) -> FloatImage:
        """Return the picture: float [h, w, 3], over the scene's background, in [0, 1]."""
        return self.means.colors

    @property
    def own_psnr(self) -> float:
        """Return the PSNR of the picture, in decibels, as its own rays tell it."""
        return psnr(float(np.mean(self.means.variances, dtype=np.float64)))

    @property
    def share_on_volume(self) -> float:
        """Return the share of the pixels that show the volume."""
        return float(self.on_volume.mean())

    @property
    def shows_volume(self) -> bool:
        """Return whether any pixel shows the volume."""
        return bool(self.on_volume.any())

    def accuracy_of(self, picture: FloatImage) -> Accuracy:
        """Compare a picture over the background, float64 [h, w, 3], with the truth."""
        return measure_accuracy(picture, self.means, self.on_volume)

    def errors_of(self, picture: FloatImage) -> PictureErrors:
        """Return the errors of a picture over the background, float64 [h, w, 3]."""
        return PictureErrors(self.frame, picture - self.means.colors, self.means.variances, self.on_volume)


@dataclass(frozen=True)
class SampledTruth:
    """A truth of some pixels of one frame; otherwise as Truth. shows_volume: whether its picture does."""

    frame: int
    exact: ExactPixels
    shows_volume: bool

    def accuracy_of(self, picture: FloatImage) -> Accuracy:
        """Estimate the accuracy of a picture over the background, float64 [h, w, 3]."""
        return sampled_accuracy(self.exact.compare_picture(picture).samples)


def compute_truth(
    film: FilmStage, frame: int, tolerance: float, *, num_threads: int = 2, on_progress: Progress = ignore
) -> Truth:
    """Compute the truth of a frame, with rays that are exact to `tolerance` in every channel.

    Raises RenderError if one does not converge.

    on_progress: as in `RayIntegrator.converge`.
    """
    stage = film.at(frame)
    scene, view = stage.scene, view_of(stage, frame)
    rays = SceneRays(stage, num_threads=num_threads)
    found = mean_over_pixels(rays, view, scene.background, tolerance, seed=(frame,), on_progress=on_progress)
    return Truth(frame, found.means, found.is_seen, found.convergence, float(found.num_rays.mean()))


def sample_truths(
    film: FilmStage, frames: Sequence[int], tolerance: float, rasterizer: Rasterizer, *, clock: Clock, num_threads: int
) -> list[SampledTruth]:
    """Compute the truth of some pixels of each frame, chosen by its picture at the scene's tolerance.

    tolerance: as in `compute_truth`.
    """
    prober = FrameProber(film.first, NUM_SAMPLED_PIXELS, num_threads=num_threads, tolerance=tolerance)
    return [
        SampledTruth(
            frame.number,
            prober.on(frame.stage).exact_pixels(frame.number, frame.image),
            bool(frame.radiance[..., 3].any()),
        )
        for frame in render_frames(film, frames, rasterizer, clock=clock)
    ]


def is_loop(path: CameraPath) -> bool:
    """Return whether the last frame of a path leads back to the first."""
    return not isinstance(path, KeyframePath) or path.loop


def with_a_neighbour(frames: Sequence[int], num_frames: int) -> list[int]:
    """Return spread frames of a path of `num_frames`, with the one after a middle frame unless two are neighbours.

    Their errors tell flicker. The first frame often looks along an axis of the volume, as few others do.
    """
    middle = frames[len(frames) // 2]
    has_neighbours = any(frame + 1 in frames for frame in frames)
    return [*frames] if has_neighbours or middle + 1 >= num_frames else sorted({*frames, middle + 1})


def spread_evenly(items: Sequence[T], num: int, *, is_loop: bool) -> list[T]:
    """Return at most `num` evenly spread items, such as frames: around a loop, or with the first and the last."""
    num = min(num, len(items))
    span = len(items) if is_loop or num == 1 else len(items) - 1
    return [items[i * span // (num if is_loop or num == 1 else num - 1)] for i in range(num)]
