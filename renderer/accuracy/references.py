"""Compare the trial pictures of a search with a reference: a few exact rays of each frame, or whole exact pictures.

Both references compare a picture before it is rounded. They return the value of the wanted metric, and the standard
deviation of the mean squared error: 0 if the value is no estimate. num_frames: the largest number of frames that a
search for one tolerance tries. step: the smallest factor between tolerances whose accuracies the reference can tell
apart.
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
from renderer.frame import FilmStage, Frame
from renderer.scene import MetricTarget
from renderer.truth import PixelMeans


class ExactRays:
    """A reference of a few exact rays of each frame, which estimate PSNR and RMSE.

    The pixels of the rays are chosen by the first trial picture of the frame. The factor `step` is about 1 dB.
    """

    num_frames, step = 16, 1.12

    def __init__(self, film: FilmStage, want: MetricTarget, *, num_threads: int) -> None:
        self.want, self._prober = want, FrameProber(film.first, NUM_SAMPLED_PIXELS, num_threads=num_threads)
        self._exact: dict[int, ExactPixels] = {}  # the exact pixels of each frame so far
        self.shows_volume = False  # whether any of the pictures shows the volume

    def compare(self, frame: Frame) -> tuple[float, float]:
        """Return the metric of a trial picture, estimated from the rays, and the deviation of its squared error."""
        self.shows_volume |= bool(frame.radiance[..., 3].any())
        if frame.number not in self._exact:
            self._exact[frame.number] = self._prober.on(frame.stage).exact_pixels(frame.number, frame.image)
        samples = self._exact[frame.number].compare_radiance(frame.radiance).samples
        value = psnr(samples.mean) if self.want.metric == "psnr" else math.sqrt(max(samples.mean, 0.0))
        return value, samples.deviation


class ExactPictures:
    """A reference of whole exact pictures of frames, which take long to compute but give every metric.

    Any two tolerances can be told apart, so that `step` is 1. The pictures and their variances are kept in float32, 24
    bytes a pixel. Trial pictures are rounded to float32, too, so that equal pictures stay equal: values change by at
    most 3e-8, and an RMSE by 6e-8, which is 0.005 dB at 80 dB.
    """

    num_frames, step = 10, 1.0

    def __init__(self, want: MetricTarget, find_truth: Callable[[int], Truth]) -> None:
        self.want, self._find_truth = want, find_truth
        self._truths: dict[int, Truth] = {}  # the exact picture of each frame so far

    @property
    def shows_volume(self) -> bool:
        """Return whether any of the pictures shows the volume; otherwise any tolerance would be exact enough."""
        return any(truth.shows_volume for truth in self._truths.values())

    def compare(self, frame: Frame) -> tuple[float, float]:
        """Return the metric of a trial picture over all pixels, and the deviation 0: nothing is estimated."""
        if frame.number not in self._truths:
            truth = self._find_truth(frame.number)
            means = PixelMeans(*(each.astype(np.float32) for each in truth.means))
            self._truths[frame.number] = replace(truth, means=means)
        picture = frame.unrounded.astype(np.float32).astype(np.float64)
        return compute_metric(self.want.metric, picture, self._truths[frame.number].means), 0.0


Reference = ExactRays | ExactPictures
