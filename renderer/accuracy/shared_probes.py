"""Choose probes that two neighbouring frames share, and estimate by how much errors change from one to the other.

The record of each frame keeps its errors at shared probes, and they are compared once all frames of a film are there:
frames may be drawn in any order, by any process, or may be kept from an earlier job. A shared probe is therefore chosen
by chance alone, not by a picture. It is one channel of a pixel, so that a frame keeps one number for each probe.

If the error at a probe changes from a to b, the mean of (b - a)^2 is mean(a^2) + mean(b^2) - 2 mean(a b). The first two
terms are the mean squared errors of the frames, which all probes estimate: shared probes are needed for a b alone. Each
frame has rays of its own at shared probes, so that the rays' own errors cancel in a b. In frames of a turntable, a b
has a fourth of the deviation of (b - a)^2.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from renderer.accuracy.estimate import DEVIATIONS, ErrorSamples, error_samples
from renderer.volume import Float64, Int64

# The path is divided into at most this many equal parts, in each of which one pair of neighbouring frames shares
# probes.
_MOST_PAIRS = 64
# A part of the path has at least this many frames. With parts of two frames, pairs could keep step with a motion that
# changes every second frame.
_FEWEST_FRAMES = 3
# A number in the seed of the choice of pairs, which makes it independent of the choice of pixels.
_OF_PAIRS = 1
# A number in the seed of the choice of pixels, which makes it independent of the choice of pairs.
_OF_PIXELS = 2


class SharedPixels(NamedTuple):
    """Probes that two neighbouring frames share.

    first: the number of the first frame.
    numbers: int64 [n], the numbers of pixels, row by row from the top left corner.
    channels: int64 [n], the channel of each pixel, 0 to 2.
    """

    first: int
    numbers: Int64
    channels: Int64


class SharedErrors(NamedTuple):
    """The errors of a frame at the probes that it shares with a neighbouring frame.

    first: the number of the first of the two frames.
    errors: picture minus truth, in [-1, 1]; NaN for a pixel over which an annotation is drawn.
    """

    first: int
    errors: tuple[float, ...]


def first_of_pair(frame: int, num_frames: int) -> int | None:
    """Return the first frame of the pair of frames that share probes and have `frame` among them; None without a pair.

    num_frames: the number of frames of the path.
    """
    in_part = max(min(_FEWEST_FRAMES, num_frames), -(-num_frames // _MOST_PAIRS))
    part = frame // in_part
    num_here = min(in_part, num_frames - part * in_part)
    if num_here < 2:
        return None
    first = part * in_part + int(np.random.default_rng((_OF_PAIRS, part)).integers(num_here - 1))
    return first if first <= frame <= first + 1 else None


def shared_pixels(first: int, num_pixels: int, num_probes: int, seed: int) -> SharedPixels:
    """Choose the probes that frame `first` and the next frame share: one in each of equal parts of a picture.

    The mean of a quantity over the probes estimates its mean over all pixels and channels.
    """
    random, each = np.random.default_rng((_OF_PIXELS, seed, first)), np.arange(num_probes)
    places = (each + random.random(num_probes)) * (num_pixels / num_probes)
    numbers = np.minimum(places.astype(np.int64), num_pixels - 1)
    return SharedPixels(first, numbers, random.integers(3, size=num_probes))


def error_products(before: SharedErrors, after: SharedErrors) -> ErrorSamples | None:
    """Return a summary of the products of the errors of two frames at shared probes.

    None if annotations are drawn over all of the probes.
    """
    assert before.first == after.first and len(before.errors) == len(after.errors)
    products: Float64 = np.multiply(before.errors, after.errors)
    products = products[~np.isnan(products)]
    return error_samples(products) if products.size else None


def estimate_flicker(errors: ErrorSamples, products: ErrorSamples) -> tuple[float, tuple[float, float]]:
    """Return the root mean square change of errors between neighbouring frames, and its interval; all in [0, 1].

    errors: samples of the squared error of all frames. products: samples of the products of errors of all pairs.

    Large errors may be in few pixels, and equal in both frames: a product that shared probes have missed may be as
    large as the largest squared error at any probe.
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
