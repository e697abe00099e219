"""Choose probes that two neighbouring frames share, and estimate by how much errors change from one to the other.

The errors of each frame are kept by itself, and compared once the frames of a film are known: frames may be drawn in
any order, by any process, or may be kept from an earlier job. A probe is therefore chosen by chance alone, not by a
picture, and is one channel of a pixel: a frame keeps one number for each.

The mean square of the change of an error, from a to b, is that of a, and of b, without twice the mean of a b. The first
two are the mean squared errors, which all probes tell, so that shared probes tell a b alone: their rays are their own
in each frame, and the errors of these cancel. In frames of a turntable, a b has a fourth of the deviation of (b - a)^2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from renderer.accuracy.estimate import DEVIATIONS, ErrorSamples, error_samples
from renderer.volume import Float64, Int64

# The most pairs of neighbouring frames of a path that share probes: one in each of as many equal parts of the path.
_MOST_PAIRS = 64
# The fewest frames of a part of a path. With parts of two frames, pairs would be in step with what moves in steps.
_FEWEST_FRAMES = 3
# Numbers that tell the choices of a seed apart.
_OF_PAIRS, _OF_PIXELS = 1, 2


class SharedPixels(NamedTuple):
    """Probes that two neighbouring frames share. first: the number of the first frame.

    numbers: of pixels, row by row from the top left corner, int64 [n]. channels: of each, 0 to 2, int64 [n].
    """

    first: int
    numbers: Int64
    channels: Int64


class SharedErrors(NamedTuple):
    """The errors of a frame at the probes that it shares. first: the number of the first of the two frames.

    errors: with their signs, in [-1, 1]; NaN where something is drawn over the pixel.
    """

    first: int
    errors: tuple[float, ...]


def first_of_pair(frame: int, num_frames: int) -> int | None:
    """Return the first of the two frames that share probes, one of which is `frame`; None if it shares none.

    num_frames: of the path.
    """
    in_part = max(min(_FEWEST_FRAMES, num_frames), -(-num_frames // _MOST_PAIRS))
    part = frame // in_part
    num_here = min(in_part, num_frames - part * in_part)
    if num_here < 2:
        return None
    first = part * in_part + int(np.random.default_rng((_OF_PAIRS, part)).integers(num_here - 1))
    return first if first <= frame <= first + 1 else None


def shared_pixels(first: int, num_pixels: int, num_probes: int, seed: int) -> SharedPixels:
    """Choose probes for two frames from `first` on: one in each of equal parts of a picture.

    The mean of any quantity over pixels and channels is expected to be that over the probes.
    """
    random, each = np.random.default_rng((_OF_PIXELS, seed, first)), np.arange(num_probes)
    places = (each + random.random(num_probes)) * (num_pixels / num_probes)
    numbers = np.minimum(places.astype(np.int64), num_pixels - 1)
    return SharedPixels(first, numbers, random.integers(3, size=num_probes))


def error_products(before: SharedErrors, after: SharedErrors) -> ErrorSamples | None:
    """Return samples of the product of the errors of a channel in two frames; None if all probes are drawn over."""
    assert before.first == after.first and len(before.errors) == len(after.errors)
    products: Float64 = np.multiply(before.errors, after.errors)
    products = products[~np.isnan(products)]
    return error_samples(products) if products.size else None


def estimate_flicker(errors: ErrorSamples, products: ErrorSamples) -> tuple[float, tuple[float, float]]:
    """Return the root mean square change of errors between neighbouring frames, and its interval; all in [0, 1].

    errors: samples of the squared error of all frames. products: of all pairs.

    The error may be in few pixels, and the same in both frames: the product that shared probes may have missed is as
    large as the squared errors that others have seen.
    """
    low, high = errors.interval
    larger = products.with_missed(max(products.largest, errors.largest))
    more = larger.mean - products.mean + DEVIATIONS * larger.deviation
    less = products.mean - products.with_missed(-products.largest).mean + DEVIATIONS * products.deviation
    change = 2 * (errors.mean - products.mean)
    least = change - 2 * math.hypot(errors.mean - low, more)
    most = change + 2 * math.hypot(high - errors.mean, less)
    found, least, most = (math.sqrt(min(max(each, 0.0), 4 * high)) for each in (change, least, most))
    return found, (least, most)
