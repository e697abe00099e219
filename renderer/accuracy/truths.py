"""Compute the truth of a frame, and choose the frames that are worth comparing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from renderer.accuracy.metrics import Accuracy, FloatImage, measure_accuracy, sampled_accuracy
from renderer.accuracy.prober import ExactPixels, FrameProber
from renderer.draw import Rasterizer
from renderer.film import over_background
from renderer.frame import Clock, FilmStage, render_frames, view_of
from renderer.scene import CameraPath, KeyframePath
from renderer.truth import Convergence, Progress, SceneRays, ignore
from renderer.volume import Bools

T = TypeVar("T")

# The convergence of a truth in every channel: a thousandth of the RMSE of a picture with 40 dB.
TRUTH_TOLERANCE = 1e-5
# Exact rays of a frame without a whole truth: its PSNR is then known to about 1 dB.
NUM_SAMPLED_PIXELS = 1024


@dataclass(frozen=True)
class Truth:
    """A truth: the converged ray integral of one frame.

    picture: float64 [h, w, 3], over the scene's background, clipped to [0, 1].
    on_volume: bool [h, w], where anything of the volume is visible.
    convergence: the changes as the step was halved. seconds: the time that it took, where somebody has timed it.
    """

    frame: int
    picture: FloatImage
    on_volume: Bools
    convergence: Convergence
    seconds: float = 0.0

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
        return measure_accuracy(picture, self.picture, self.on_volume)


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
    """Compute the truth of a frame to `tolerance` in every channel. Raises RenderError if it does not converge.

    on_progress: as in `RayIntegrator.converge`.
    """
    stage = film.at(frame)
    scene, view = stage.scene, view_of(stage, frame)
    (width, height), rays = view.size, SceneRays(stage, num_threads=num_threads)
    pixels, convergence = rays.converge(view, np.arange(width * height), tolerance, on_progress)
    image = pixels.reshape(height, width, 4)
    return Truth(frame, over_background(image, scene.background), image[..., 3] > 0, convergence)


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


def spread_evenly(items: Sequence[T], num: int, *, is_loop: bool) -> list[T]:
    """Return at most `num` evenly spread items, such as frames: around a loop, or with the first and the last."""
    num = min(num, len(items))
    span = len(items) if is_loop or num == 1 else len(items) - 1
    return [items[i * span // (num if is_loop or num == 1 else num - 1)] for i in range(num)]
