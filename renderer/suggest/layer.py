"""Describe a layer of values: a weight for each value, which is large where the value is typical of the layer."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from renderer.volume import Bools, Float64

# A value is part of a layer if its weight in the layer is at least this; a value with less weight lies at the layer's
# edge.
_MIN_PART_WEIGHT = 0.5
# Two normalised values that differ by less than this count as equal.
_EVEN = 1e-9


@dataclass(frozen=True)
class Layer:
    """A layer of values: a material, or a range of values, with the share of the picture that it is to have.

    name: the name of the material, in words.
    knots: pairs (normalised value, weight), ascending; weights are linear between them and constant outside.
    share: the share of the picture, relative to the shares of the other layers.
    min_depth, max_depth: bounds of the optical depth at weight 1, for 1 % of the volume's diagonal; from about 1 on,
        surfaces look crisp.
    """

    name: str
    knots: tuple[tuple[float, float], ...]
    share: float = 1.0
    min_depth: float = 0.0
    max_depth: float = 6.0

    def weights(self, values: Float64) -> Float64:
        """Return the layer's weight at each normalised value. values: float64, of any shape."""
        return np.asarray(np.interp(values, *np.transpose(self.knots)), np.float64)

    def covers(self, values: Float64) -> Bools:
        """Return which normalised values are parts of the layer, and not of its edges."""
        return self.weights(values) >= _MIN_PART_WEIGHT

    def mean_weights(self, one: Float64, other: Float64) -> Float64:
        """Return the mean of the layer's weight over all values from `one` to `other`, so that no thin layer is missed.

        one, other: normalised values, arrays of one shape.
        """
        (begin, first), (end, last) = self.knots[0], self.knots[-1]
        # Beyond the outermost knots, weights are constant.
        at, weights = np.array([(begin - 2, first), *self.knots, (end + 2, last)]).T
        slopes = np.divide(np.diff(weights), np.diff(at), out=np.zeros(len(at) - 1), where=np.diff(at) > 0)
        integrals = np.append(0.0, np.cumsum((weights[1:] + weights[:-1]) / 2 * np.diff(at)))

        def integral(values: Float64) -> Float64:
            k = np.clip(np.searchsorted(at, values, side="right") - 1, 0, len(slopes) - 1)
            beyond = values - at[k]
            return np.asarray(integrals[k] + beyond * (weights[k] + slopes[k] * beyond / 2))

        change = other - one
        is_even = np.abs(change) < _EVEN
        means = np.divide(integral(other) - integral(one), change, out=np.zeros_like(change), where=~is_even)
        return np.where(is_even, self.weights((one + other) / 2), means)

    def ranges(self) -> list[tuple[float, float]]:
        """Return the ranges of normalised values whose weight is above 0; an unbounded range has an infinite end."""
        knots = [(-math.inf, self.knots[0][1]), *self.knots, (math.inf, self.knots[-1][1])]
        found: list[tuple[float, float]] = []
        for (low, first), (high, last) in pairwise(knots):
            if first > 0 or last > 0:
                begin = found.pop()[0] if found and found[-1][1] == low and first > 0 else low
                found.append((begin, high))
        return found
