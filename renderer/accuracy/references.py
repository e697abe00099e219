"""Compare trial pictures with what is exact: a few rays of each frame, or its whole picture.

Both compare a picture before it is rounded, and return the value of the metric that is wanted, and the standard
deviation of its mean squared error: 0 where that is no estimate. num_frames: the most that a search for
one tolerance tries. step: the least factor between tolerances that they can tell.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from renderer.accuracy.decibels import psnr
from renderer.accuracy.metrics import compute_metric
from renderer.accuracy.prober import ExactPixels, FrameProber
from renderer.accuracy.truths import NUM_SAMPLED_PIXELS, Truth
from renderer.film import over_background
from renderer.frame import FilmStage, Frame
from renderer.scene import MetricTarget
from renderer.truth import PixelMeans


class ExactRays:
    """A few exact rays of each frame, chosen by its first picture; they tell PSNR and RMSE.

    A step is about 1 dB.
    """

    num_frames, step = 16, 1.12

    def __init__(self, film: FilmStage, want: MetricTarget, *, num_threads: int) -> None:
        self.want, self._prober = want, FrameProber(film.first, NUM_SAMPLED_PIXELS, num_threads=num_threads)
        self._exact: dict[int, ExactPixels] = {}  # by frame
        self.shows_volume = False  # any of the pictures

    def compare(self, frame: Frame) -> tuple[float, float]:
        """Estimate the metric from the rays."""
        self.shows_volume |= bool(frame.radiance[..., 3].any())
        if frame.number not in self._exact:
            self._exact[frame.number] = self._prober.on(frame.stage).exact_pixels(frame.number, frame.image)
        samples = self._exact[frame.number].compare_radiance(frame.radiance).samples
        value = psnr(samples.mean) if self.want.metric == "psnr" else math.sqrt(max(samples.mean, 0.0))
        return value, samples.deviation


class ExactPictures:
    """A store of whole exact pictures of frames, which take long but tell any metric. A step is any, of two digits.

    They and their variances are kept in float32, 24 bytes a pixel. Pictures compared with them are rounded alike, so
    that equal pictures stay equal: values change by at most 3e-8, and an RMSE by 6e-8, which is 0.005 dB at 80 dB.
    """

    num_frames, step = 10, 1.0

    def __init__(self, want: MetricTarget, find_truth: Callable[[int], Truth]) -> None:
        self.want, self._find_truth = want, find_truth
        self._truths: dict[int, Truth] = {}  # by frame

    @property
    def shows_volume(self) -> bool:
        """Return whether any of the pictures shows the volume; else any tolerance would do."""
        return any(truth.shows_volume for truth in self._truths.values())

    def compare(self, frame: Frame) -> tuple[float, float]:
        """Compute the metric over all pixels."""
        if frame.number not in self._truths:
            truth = self._find_truth(frame.number)
            means = PixelMeans(*(each.astype(np.float32) for each in truth.means))
            self._truths[frame.number] = replace(truth, means=means)
        background = frame.stage.scene.background
        picture = over_background(frame.radiance, background).astype(np.float32).astype(np.float64)
        return compute_metric(self.want.metric, picture, self._truths[frame.number].means), 0.0


Reference = ExactRays | ExactPictures
