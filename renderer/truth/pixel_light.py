"""Compute the mean light of pixels by paths, in two independent halves, with a standard error.

A pixel is divided into side x side equal squares, and four rays pass through random places of each: one for each of two
parts u and v of each half. So the halves x1 and x2 are independent, and (a - x1)(a - x2) has the expectation of the
squared error of a number a, without the noise of the paths: with their mean m it is (a - m)^2 - (x1 - x2)^2 / 4. The
differences of the rays of squares give the standard error of the mean of both halves. How many rays pixels need is
decided by other rays, which are not used again, and all pixels get equally many: otherwise pixels whose paths happen to
be dark would end too early (Kirk and Arvo 1991).

A picture shows f(x), the encoding of linear light x as sRGB, after the mean over the pixel. As f is bent, f of a noisy
mean is too dark: by b for a half, and by nearly 2 b for a part, which has twice the variance. So a half is shown as
2 f((u + v) / 2) - (f(u) + f(v)) / 2, which has no error of the order of b.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from renderer.film import over_rows
from renderer.truth.integrator import Progress, ignore
from renderer.truth.path_tracer import PathTracer
from renderer.truth.pixel_means import PixelMeans
from renderer.truth.places import places_in_pixels, states_of
from renderer.view import View
from renderer.volume import Float64, Int64

# The number of paths that begin on each ray. On two CT scans, at about 128 paths a pixel, 4 and 8 had the least product
# of variance and time; 2 had 1.2 to 1.3 times as much, and 16 had 1.3 to 1.6 times as much.
PATHS_PER_RAY = 4
# The number of halves of a pixel.
_NUM_HALVES = 2
# The number of parts of a half.
_NUM_PARTS = 2
# The number of rays through each square of a pixel, one for each part of a half.
_RAYS_PER_SQUARE = _NUM_HALVES * _NUM_PARTS
# The numbers of squares along a side of a pixel for the rays that decide how many rays pixels need.
_FIRST_SIDES = (2, 4)
# The standard error is taken to be proportional to side^-p, with p from 1, that of independent paths, to this number.
# Of an engine and a head it was 1.2 to 1.3 up to a side of 12, because squares are smaller, and encoding less bent.
# With p of 1 for all, pixels had up to four times as many paths as they needed.
_LARGEST_POWER = 1.25
# At most this many rays are traced at once, which bounds the memory.
_RAYS_AT_ONCE = 2**17


class PixelLight(NamedTuple):
    """The mean light of pixels.

    parts: float64 [2, 2, n, 4], linear radiance and opacity, independent estimates of the mean over each pixel: the two
        parts of each of two halves.
    standard_errors: float64 [n, 4], of the mean of both halves. num_paths: the number of paths in each pixel.
    """

    parts: Float64
    standard_errors: Float64
    num_paths: int

    @property
    def halves(self) -> Float64:
        """Return the two independent estimates, float64 [2, n, 4]."""
        return np.asarray(self.parts.mean(axis=1))

    @property
    def colors(self) -> Float64:
        """Return the mean of both halves, float64 [n, 4]."""
        return np.asarray(self.halves.mean(axis=0))

    @property
    def standard_error(self) -> float:
        """Return the root mean square of the standard errors of red, green and blue over all pixels."""
        return math.sqrt(float((self.standard_errors[:, :3] ** 2).mean()))

    def shown(self, behind: Float64, exposure: float) -> PixelMeans:
        """Return the means of pixels as pictures show them, which may be a little above 1.

        The variances are unbiased, and each is known from two halves alone: their mean over many pixels is exact.
        behind: [n, 3], the background behind each pixel, in linear light. exposure: the factor on all light.
        """
        radiance = self.parts * (*[exposure] * 3, 1.0)
        of_halves, of_parts = (
            over_rows(each.reshape(-1, len(behind), 4).transpose(1, 0, 2), behind, is_linear=True).transpose(1, 0, 2)
            for each in (radiance.mean(axis=1), radiance)
        )
        shown = 2.0 * of_halves - of_parts.reshape(_NUM_HALVES, _NUM_PARTS, -1, 3).mean(axis=1)
        return PixelMeans(shown.mean(axis=0), (shown[0] - shown[1]) ** 2 / 4.0)


def standard_error_of(light: PixelLight) -> float:
    """Return the standard error of linear light."""
    return light.standard_error


def light_of_pixels(
    tracer: PathTracer,
    view: View,
    pixels: Int64,
    *,
    seed: Sequence[int],
    standard_error: float,
    most_paths: int,
    error_of: Callable[[PixelLight], float] = standard_error_of,
    on_progress: Progress = ignore,
) -> PixelLight:
    """Return the mean light of pixels, by as many paths as a standard error needs, and at most a given number.

    pixels: int64 [n], their numbers, row by row, each once. seed: of the scene and the frame; the seed and a pixel's
        number decide its paths.
    standard_error: the wanted standard error; 0 for as many paths as are allowed.
    most_paths: the most paths in a pixel; pixels have at least 4 * PATHS_PER_RAY.
    error_of: the function whose value for the light is the standard error, that of linear light or another.
    """
    side, last, power = max(1, math.isqrt(most_paths // (_RAYS_PER_SQUARE * PATHS_PER_RAY))), math.inf, 1.0
    for first in _FIRST_SIDES if standard_error > 0.0 else ():
        if first >= side:
            break
        error = error_of(_traced(tracer, view, pixels, first, (*seed, 0), ignore))
        if 0.0 < error < last < math.inf:
            power = min(max(math.log2(last / error), 1.0), _LARGEST_POWER)
        needed = first * min(error / standard_error, float(side)) ** (1.0 / power)
        side, last = min(side, max(1, math.ceil(needed))), error
    return _traced(tracer, view, pixels, side, (*seed, 1), on_progress)


def _traced(
    tracer: PathTracer, view: View, pixels: Int64, side: int, seed: Sequence[int], on_progress: Progress
) -> PixelLight:
    """Return the mean light of pixels with side x side squares."""
    num_squares, num_at_once = side**2, max(1, _RAYS_AT_ONCE // (_RAYS_PER_SQUARE * side**2))
    parts, variances = np.empty((_RAYS_PER_SQUARE, pixels.size, 4)), np.empty((pixels.size, 4))
    for begin in range(0, pixels.size, num_at_once):
        chosen = slice(begin, begin + num_at_once)
        num = pixels[chosen].size
        places = places_in_pixels(pixels[chosen], view.size[0], np.full(num, side), _RAYS_PER_SQUARE, seed)
        states = states_of(np.repeat(pixels[chosen], _RAYS_PER_SQUARE * num_squares), (*seed, 1))

        def tell(share: float, begin: int = begin, num: int = num) -> None:
            on_progress((begin + share * num) / pixels.size)

        radiance = tracer.trace(view, places.reshape(-1, 2), states, PATHS_PER_RAY, tell)
        by_square = radiance.reshape(num, num_squares, _RAYS_PER_SQUARE, 4)
        parts[:, chosen] = by_square.mean(axis=1).transpose(1, 0, 2)
        variances[chosen] = by_square.var(axis=2, ddof=1).sum(axis=1) / (_RAYS_PER_SQUARE * num_squares**2)
    shape = (_NUM_HALVES, _NUM_PARTS, pixels.size, 4)
    return PixelLight(parts.reshape(shape), np.sqrt(variances), _RAYS_PER_SQUARE * num_squares * PATHS_PER_RAY)
