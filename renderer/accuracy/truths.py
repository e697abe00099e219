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
from renderer.truth import Convergence, PixelMeans, Progress, ScenePaths, SceneRays, ignore, mean_over_pixels
from renderer.volume import Bools

T = TypeVar("T")

# The rays of a truth count as converged if halving their step changes no channel, in [0, 1], by this much. Rays then
# had errors of 119 dB. The errors of pixels are far larger, because each is the mean of a few rays.
TRUTH_TOLERANCE = 1e-4
# The wanted standard error of a truth by paths, of colours in [0, 1]: a PSNR of 46 dB.
TRUTH_STANDARD_ERROR = 0.005
# The number of pixels with exact rays in a frame without a whole truth: its PSNR is then known to about 1 dB.
NUM_SAMPLED_PIXELS = 1024


@dataclass(frozen=True)
class Truth:
    """A truth: the exact picture of one frame, from converged rays.

    means: [h, w, 3], the mean over each pixel. on_volume: bool [h, w], whether anything of the volume is visible.
    convergence: the changes of the rays each time that their step was halved; paths have no steps.
    rays_per_pixel: the mean number of rays of a pixel.
    seconds: the time that computing it took; 0 if it was not timed.
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
    def standard_error(self) -> float:
        """Return the root of the mean variance of the pixels."""
        return float(np.sqrt(np.mean(self.means.variances, dtype=np.float64)))

    @property
    def own_psnr(self) -> float:
        """Return the PSNR of the truth itself, in decibels, estimated from the variances of its pixels."""
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
        """Return the accuracy of a picture of the frame. picture: float64 [h, w, 3], already over the background."""
        return measure_accuracy(picture, self.means, self.on_volume)

    def errors_of(self, picture: FloatImage) -> PictureErrors:
        """Return the errors of a picture of the frame. picture: float64 [h, w, 3], already over the background."""
        return PictureErrors(self.frame, picture - self.means.colors, self.means.variances, self.on_volume)


@dataclass(frozen=True)
class SampledTruth:
    """A truth of some pixels of one frame.

    exact: the exact colours of the pixels. shows_volume: whether the drawn picture of the frame shows the volume.
    """

    frame: int
    exact: ExactPixels
    shows_volume: bool

    def accuracy_of(self, picture: FloatImage) -> Accuracy:
        """Estimate the accuracy of a picture of the frame. picture: float64 [h, w, 3], already over the background."""
        return sampled_accuracy(self.exact.compare_picture(picture).samples)


def compute_truth(
    film: FilmStage,
    frame: int,
    tolerance: float,
    *,
    standard_error: float = TRUTH_STANDARD_ERROR,
    num_threads: int = 2,
    on_progress: Progress = ignore,
) -> Truth:
    """Compute the truth of a frame. Raises RenderError if a ray does not converge.

    tolerance, on_progress: as in `RayIntegrator.converge`. standard_error: of paths, as of `ScenePaths.converge`, for a
    scene with `light`.
    """
    stage = film.at(frame)
    view, background, seed = view_of(stage, frame), stage.scene.background, (frame,)
    if stage.scene.light is None:
        rays = SceneRays(stage, num_threads=num_threads)
        found = mean_over_pixels(rays, view, background, tolerance, seed=seed, on_progress=on_progress)
    else:
        paths = ScenePaths(stage, num_threads=num_threads)
        found = paths.converge(view, background, standard_error, seed=seed, on_progress=on_progress)
    return Truth(frame, found.means, found.is_seen, found.convergence, float(found.num_rays.mean()))


def sample_truths(
    film: FilmStage, frames: Sequence[int], tolerance: float, rasterizer: Rasterizer, *, clock: Clock, num_threads: int
) -> list[SampledTruth]:
    """Compute the truth of some pixels of each frame, which are chosen by drawing the frame at the scene's tolerance.

    tolerance: of the exact rays, as in `RayIntegrator.converge`.
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
    """Return whether a path is a loop, whose last frame comes just before the first."""
    return not isinstance(path, KeyframePath) or path.loop


def with_a_neighbour(frames: Sequence[int], num_frames: int) -> list[int]:
    """Return frames of a path of `num_frames`, with one more if no two are neighbours: the one after the middle frame.

    Flicker is measured between neighbours. The pair is not at the first frame, which often looks along an axis of the
    volume, as few other frames do.
    """
    middle = frames[len(frames) // 2]
    has_neighbours = any(frame + 1 in frames for frame in frames)
    return [*frames] if has_neighbours or middle + 1 >= num_frames else sorted({*frames, middle + 1})


def spread_evenly(items: Sequence[T], num: int, *, is_loop: bool) -> list[T]:
    """Return at most `num` evenly spread items, such as frames: around a loop, or with the first and the last."""
    num = min(num, len(items))
    span = len(items) if is_loop or num == 1 else len(items) - 1
    return [items[i * span // (num if is_loop or num == 1 else num - 1)] for i in range(num)]
