"""Compute the mean light of pixels by paths, in two independent halves, with a standard error.

A pixel is divided into side x side equal squares, and two rays pass through random places of each: one for each half.
So the halves x1 and x2 are independent, and (a - x1)(a - x2) has the expectation of the squared error of a number a,
without the noise of the paths. The differences of the two rays of squares give the standard error of the mean of both
halves. How many rays pixels need is decided by other rays, which are not used again, and all pixels get equally many:
otherwise pixels whose paths happen to be dark would end too early (Kirk and Arvo 1991).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.truth.integrator import Progress, ignore
from renderer.truth.path_tracer import PathTracer
from renderer.truth.places import places_in_pixels, states_of
from renderer.view import View
from renderer.volume import Float64, Int64

# The number of paths that begin on each ray. On two CT scans, at about 128 paths a pixel, 4 and 8 had the least product
# of variance and time; 2 had 1.2 to 1.3 times as much, and 16 had 1.3 to 1.6 times as much.
PATHS_PER_RAY = 4
# The number of halves of a pixel, and of rays through each of its squares.
_NUM_HALVES = 2
# The number of squares along a side of a pixel for the rays that decide how many rays pixels need.
_FIRST_SIDE = 2
# At most this many rays are traced at once, which bounds the memory.
_RAYS_AT_ONCE = 2**17


class PixelLight(NamedTuple):
    """The mean light of pixels.

    halves: float64 [2, n, 4], linear radiance and opacity, two independent estimates of the mean over each pixel.
    standard_errors: float64 [n, 4], of the mean of both halves. num_paths: the number of paths in each pixel.
    """

    halves: Float64
    standard_errors: Float64
    num_paths: int

    @property
    def colors(self) -> Float64:
        """Return the mean of both halves, float64 [n, 4]."""
        return np.asarray(self.halves.mean(axis=0))

    @property
    def standard_error(self) -> float:
        """Return the root mean square of the standard errors of red, green and blue over all pixels."""
        return math.sqrt(float((self.standard_errors[:, :3] ** 2).mean()))


def light_of_pixels(
    tracer: PathTracer,
    view: View,
    pixels: Int64,
    *,
    seed: Sequence[int],
    standard_error: float,
    most_paths: int,
    on_progress: Progress = ignore,
) -> PixelLight:
    """Return the mean light of pixels, by as many paths as a standard error needs, and at most a given number.

    pixels: int64 [n], their numbers, row by row, each once. seed: of the scene and the frame; the seed and a pixel's
        number decide its paths.
    standard_error: the wanted `PixelLight.standard_error`; 0 for as many paths as are allowed.
    most_paths: the most paths in a pixel; pixels have at least 2 * PATHS_PER_RAY.
    """
    side = max(1, math.isqrt(most_paths // (_NUM_HALVES * PATHS_PER_RAY)))
    if standard_error > 0.0 and side > _FIRST_SIDE:
        first = _traced(tracer, view, pixels, _FIRST_SIDE, (*seed, 0), ignore)
        # The squared standard error is proportional to 1 / side^2; the variance within smaller squares is less.
        needed = _FIRST_SIDE * min(first.standard_error / standard_error, float(side))
        side = min(side, max(1, math.ceil(needed)))
    return _traced(tracer, view, pixels, side, (*seed, 1), on_progress)


def _traced(
    tracer: PathTracer, view: View, pixels: Int64, side: int, seed: Sequence[int], on_progress: Progress
) -> PixelLight:
    """Return the mean light of pixels with side x side squares."""
    num_squares, num_at_once = side**2, max(1, _RAYS_AT_ONCE // (_NUM_HALVES * side**2))
    halves, variances = np.empty((_NUM_HALVES, pixels.size, 4)), np.empty((pixels.size, 4))
    for begin in range(0, pixels.size, num_at_once):
        chosen = slice(begin, begin + num_at_once)
        num = pixels[chosen].size
        places = places_in_pixels(pixels[chosen], view.size[0], np.full(num, side), _NUM_HALVES, seed)
        states = states_of(np.repeat(pixels[chosen], _NUM_HALVES * num_squares), (*seed, 1))

        def tell(share: float, begin: int = begin, num: int = num) -> None:
            on_progress((begin + share * num) / pixels.size)

        radiance = tracer.trace(view, places.reshape(-1, 2), states, PATHS_PER_RAY, tell)
        by_square = radiance.reshape(num, num_squares, _NUM_HALVES, 4)
        halves[:, chosen] = by_square.mean(axis=1).transpose(1, 0, 2)
        variances[chosen] = ((by_square[:, :, 0] - by_square[:, :, 1]) ** 2).sum(axis=1) / (2 * num_squares) ** 2
    return PixelLight(halves, np.sqrt(variances), _NUM_HALVES * num_squares * PATHS_PER_RAY)
