"""Estimate a mean squared error, and an interval that holds it, from samples with this error as their expectation.

A sample is the squared difference of a pixel from the mean of its exact rays, less the variance of this mean: so a
sample, and the mean of samples, may be below 0 if the error is small. Few pixels have most of the error, and a few
probes may miss them: the upper end of the interval is therefore computed with one more sample, several times as large
as the largest one. The lower end is at least 0; if it is 0, only an upper bound of the error is known.
docs/benchmarks/probes.md says how often intervals hold the error.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from renderer.volume import Float64

# The size of the additional sample, which stands for pixels that samples may have missed, as a multiple of the largest
# sample. With 2 alone, without _UNSEEN_OF_FEW, intervals of 16 probes hold the error in 66 to 97 % of cases; with 10
# alone, intervals of a film are twice as wide as they need to be.
_UNSEEN = 2.0
# This number, divided by the number of samples, is added to the multiple _UNSEEN: few samples miss more.
_UNSEEN_OF_FEW = 128.0
# The additional sample is at least this large: the squared error of half a level of 8 bits.
_LEAST_UNSEEN = (0.5 / 255) ** 2
# 95 % of a normal distribution are within this many standard deviations of its mean.
DEVIATIONS = 1.96


@dataclass(frozen=True)
class ErrorSamples:
    """A summary of samples of the squared error of a picture, or of several pictures.

    num: the number of samples.
    mean: the mean of the samples, which estimates the mean squared error and may be below 0 by chance.
    variance: the variance of the samples within each picture.
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
        """Return two mean squared errors, between which the true error lies in 95 % of cases or more."""
        missed = replace(self, mean=max(self.mean, 0.0)).with_missed(self.largest)
        low = self.mean - DEVIATIONS * self.deviation
        return max(low, 0.0), missed.mean + DEVIATIONS * missed.deviation

    def times(self, factor: float) -> ErrorSamples:
        """Return the summary of the samples multiplied by a factor of 0 or more."""
        return ErrorSamples(self.num, factor * self.mean, factor**2 * self.variance, factor * self.largest)

    def with_missed(self, largest: float) -> ErrorSamples:
        """Return the summary with the additional sample, for an error that was missed; `num` stays the same.

        largest: the largest known sample, of which the additional one is a multiple; below 0 to lower the mean.
        """
        unseen = (_UNSEEN + _UNSEEN_OF_FEW / self.num) * largest
        unseen = math.copysign(max(abs(unseen), _LEAST_UNSEEN), unseen)
        mean = (self.num * self.mean + unseen) / (self.num + 1)
        variance = (self.num * (self.variance + (self.mean - mean) ** 2) + (unseen - mean) ** 2) / (self.num + 1)
        return replace(self, mean=mean, variance=variance)


def error_samples(values: Float64) -> ErrorSamples:
    """Return the summary of the samples of one picture, float64 [n]."""
    variance = values.var(ddof=min(1, values.size - 1))
    return ErrorSamples(values.size, float(values.mean()), float(variance), float(np.abs(values).max()))


def pool_samples(pictures: Sequence[ErrorSamples]) -> ErrorSamples:
    """Return the summary of several pictures together, each of which has the same weight."""
    num = sum(each.num for each in pictures)
    variance_of_mean = sum(each.variance / each.num for each in pictures) / len(pictures) ** 2
    mean = float(np.mean([each.mean for each in pictures]))
    return ErrorSamples(num, mean, num * variance_of_mean, max(each.largest for each in pictures))
