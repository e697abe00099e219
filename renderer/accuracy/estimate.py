"""Estimate a mean squared error, and an interval that holds it, from samples whose mean it is expected to be.

Few pixels have most of the error, and a few rays may miss them: an interval from the spread of the samples alone holds
the truth in 69 to 100 % of cases in place of 95. The upper end therefore takes one more sample, several times as large
as the largest one. docs/benchmarks/probes.md says how often that holds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.volume import Float64

# The sample that may have been missed, by the largest one; at the least an error of half a level of 8 bits.
_UNSEEN, _LEAST_UNSEEN = 4.0, (0.5 / 255) ** 2
# Of the normal distribution, for 95 %.
_DEVIATIONS = 1.96


@dataclass(frozen=True)
class ErrorSamples:
    """Samples of the squared error of a picture, or of several. mean: the estimate of the mean squared error.

    variance: of the samples, within each picture. largest: the largest sample.
    """

    num: int
    mean: float
    variance: float
    largest: float

    @property
    def deviation(self) -> float:
        """Return the standard deviation of the estimate's logarithm; 0 where no sample has an error."""
        return math.sqrt(self.variance / self.num) / self.mean if self.mean > 0 else 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """Return the mean squared errors between which the true one lies in 95 % of cases, or more."""
        unseen = max(_UNSEEN * self.largest, _LEAST_UNSEEN)
        mean = (self.num * self.mean + unseen) / (self.num + 1)
        variance = (self.num * (self.variance + (self.mean - mean) ** 2) + (unseen - mean) ** 2) / (self.num + 1)
        low = self.mean / self._factor(self.mean, self.variance) if self.mean > 0 else 0.0
        return low, mean * self._factor(mean, variance)

    def _factor(self, mean: float, variance: float) -> float:
        return math.exp(_DEVIATIONS * math.sqrt(variance / self.num) / mean)


def error_samples(values: Float64) -> ErrorSamples:
    """Return what is known from samples of one picture, float64 [n]."""
    return ErrorSamples(
        values.size, float(values.mean()), float(values.var(ddof=min(1, values.size - 1))), float(values.max())
    )


def pool_samples(pictures: Sequence[ErrorSamples]) -> ErrorSamples:
    """Return what is known of pictures together, whose mean squared errors count alike."""
    num = sum(each.num for each in pictures)
    variance_of_mean = sum(each.variance / each.num for each in pictures) / len(pictures) ** 2
    mean = float(np.mean([each.mean for each in pictures]))
    return ErrorSamples(num, mean, num * variance_of_mean, max(each.largest for each in pictures))
