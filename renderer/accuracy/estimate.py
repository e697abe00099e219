"""Estimate a mean squared error, and an interval that holds it, from samples whose mean it is expected to be.

A sample is a squared difference without the variance of the rays that it is from: it may be below 0, and so may their
mean, where the error is small. Few pixels have most of the error, and a few probes may miss them: the upper end of the
interval therefore takes one more sample, several times as large as the largest one. The error is at least 0, and so is
the lower end: where it is 0, all that is known of the error is how large it is at most.
docs/benchmarks/probes.md says how often intervals hold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from renderer.volume import Float64

# The sample that may have been missed, by the largest magnitude of one: this many times, and the second divided by the
# number of samples more. With 2 alone intervals of 16 probes hold in 66 to 97 % of cases, with 10 alone those of a film
# are twice as wide as they need to be.
_UNSEEN, _UNSEEN_OF_FEW = 2.0, 128.0
# That sample at the least: an error of half a level of 8 bits.
_LEAST_UNSEEN = (0.5 / 255) ** 2
# Of the normal distribution, for 95 %.
DEVIATIONS = 1.96


@dataclass(frozen=True)
class ErrorSamples:
    """Samples of the squared error of a picture, or of several.

    mean: the estimate of the mean squared error, below 0 by chance. variance: of the samples, within each picture.
    largest: the largest magnitude of a sample.
    """

    num: int
    mean: float
    variance: float
    largest: float

    @property
    def deviation(self) -> float:
        """Return the standard deviation of the estimate."""
        return math.sqrt(self.variance / self.num)

    @property
    def interval(self) -> tuple[float, float]:
        """Return the mean squared errors between which the true one lies in 95 % of cases, or more."""
        missed = replace(self, mean=max(self.mean, 0.0)).with_missed(self.largest)
        low = self.mean - DEVIATIONS * self.deviation
        return max(low, 0.0), missed.mean + DEVIATIONS * missed.deviation

    def with_missed(self, largest: float) -> ErrorSamples:
        """Return these samples, as many as before, with the one that they may have missed.

        largest: the largest sample that is known, below 0 for one that takes away from the mean.
        """
        unseen = (_UNSEEN + _UNSEEN_OF_FEW / self.num) * largest
        unseen = math.copysign(max(abs(unseen), _LEAST_UNSEEN), unseen)
        mean = (self.num * self.mean + unseen) / (self.num + 1)
        variance = (self.num * (self.variance + (self.mean - mean) ** 2) + (unseen - mean) ** 2) / (self.num + 1)
        return replace(self, mean=mean, variance=variance)


def error_samples(values: Float64) -> ErrorSamples:
    """Return what is known from samples of one picture, float64 [n]."""
    variance = values.var(ddof=min(1, values.size - 1))
    return ErrorSamples(values.size, float(values.mean()), float(variance), float(np.abs(values).max()))


def pool_samples(pictures: Sequence[ErrorSamples]) -> ErrorSamples:
    """Return what is known of pictures together, whose mean squared errors count alike."""
    num = sum(each.num for each in pictures)
    variance_of_mean = sum(each.variance / each.num for each in pictures) / len(pictures) ** 2
    mean = float(np.mean([each.mean for each in pictures]))
    return ErrorSamples(num, mean, num * variance_of_mean, max(each.largest for each in pictures))
