"""Compare trial pictures with what is exact: a few rays of each frame, or its whole picture."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from renderer.accuracy.estimate import psnr
from renderer.accuracy.metrics import compute_metric
from renderer.accuracy.prober import ExactPixels, FrameProber
from renderer.accuracy.truths import Truth
from renderer.film import over_background
from renderer.frame import Frame, Stage
from renderer.scene import Color, MetricTarget

# Exact rays of a frame that is tried: its PSNR is then known to about 1 dB.
_NUM_RAYS = 1024


class Comparison(NamedTuple):
    """A comparison of a picture: the metric's value. deviation: as in ErrorSamples; 0 where it is no estimate."""

    value: float
    deviation: float = 0.0

    def value_if_worse(self, metric: str, deviations: float) -> float:
        """Return the value where the estimate of the mean squared error is too small by some deviations."""
        exponent = deviations * self.deviation
        return self.value - 10 / math.log(10) * exponent if metric == "psnr" else self.value * math.exp(exponent / 2)


class Reference(Protocol):
    """What is exact, and how near to it pictures are wanted.

    num_frames: the most that are tried for one tolerance. step: the least factor between tolerances that it can tell.
    """

    num_frames: int
    step: float

    @property
    def want(self) -> MetricTarget: ...

    def compare(self, frame: Frame) -> Comparison:
        """Compare the picture of a frame before it is rounded."""


class ExactRays:
    """A few exact rays of each frame, chosen by its first picture; they tell PSNR and RMSE.

    A step is about 1 dB.
    """

    num_frames, step = 16, 1.12

    def __init__(self, stage: Stage, want: MetricTarget, *, num_threads: int) -> None:
        self.want, self._prober = want, FrameProber(stage, _NUM_RAYS, num_threads=num_threads)
        self._exact: dict[int, ExactPixels] = {}  # by frame

    def compare(self, frame: Frame) -> Comparison:
        """Estimate the metric from the rays."""
        if frame.number not in self._exact:
            self._exact[frame.number] = self._prober.exact_pixels(frame.number, frame.image)
        samples = self._exact[frame.number].compare_radiance(frame.radiance).samples
        value = psnr(samples.mean) if self.want.metric == "psnr" else math.sqrt(samples.mean)
        return Comparison(value, samples.deviation)


class ExactPictures:
    """The whole exact pictures of frames, which take long; they tell any metric. A step is any, of two digits.

    Pictures are kept in float32, 12 bytes a pixel. Those compared with them are rounded alike, so that equal pictures
    stay equal: values change by at most 3e-8, a three hundredth of TRUTH_TOLERANCE, and an RMSE by 6e-8, which is 0.005
    dB at 80 dB.
    """

    num_frames, step = 10, 1.0

    def __init__(self, want: MetricTarget, background: Color | None, find_truth: Callable[[int], Truth]) -> None:
        self.want, self._background, self._find_truth = want, background, find_truth
        self._truths: dict[int, Truth] = {}  # by frame

    @property
    def shows_volume(self) -> bool:
        """Return whether any of the pictures shows the volume; else any tolerance would do."""
        return any(truth.shows_volume for truth in self._truths.values())

    def compare(self, frame: Frame) -> Comparison:
        """Compute the metric over all pixels."""
        if frame.number not in self._truths:
            truth = self._find_truth(frame.number)
            self._truths[frame.number] = replace(truth, picture=truth.picture.astype(np.float32))
        picture = over_background(frame.radiance, self._background).astype(np.float32).astype(np.float64)
        return Comparison(compute_metric(self.want.metric, picture, self._truths[frame.number].picture))
