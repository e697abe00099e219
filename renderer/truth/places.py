"""Choose the places in a picture that rays pass through: x and y in pixels from its top left corner, float64 [n, 2].

Their random numbers are those of SplitMix64, and so are the numbers of the paths that begin on the rays.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from renderer.volume import Float64, Int64, UInt64

# The step of the counter of the random number generator SplitMix64 (Steele, Lea and Flood, "Fast Splittable
# Pseudorandom Number Generators", OOPSLA 2014).
_STEP = np.uint64(0x9E3779B97F4A7C15)
# The shifts and factors by which SplitMix64 turns its counter into a random number.
_MIXING = (
    (np.uint64(30), np.uint64(0xBF58476D1CE4E5B9)),
    (np.uint64(27), np.uint64(0x94D049BB133111EB)),
    (np.uint64(31), np.uint64(1)),
)
# The number of low bits that are dropped from a random number of 64 bits, as a float64 in [0, 1) has 53 bits.
_DROPPED_BITS = np.uint64(11)
# The factor from a whole number of 53 bits to a float64 in [0, 1).
_UNIT = 2.0**-53


def pixel_centres(size: tuple[int, int]) -> Float64:
    """Return the centres of all pixels of a picture of (width, height), row by row: float64 [n, 2], x and y."""
    row, column = np.divmod(np.arange(size[0] * size[1]), size[0])
    return np.stack([column + 0.5, row + 0.5], axis=1)


def places_in_pixels(pixels: Int64, width: int, sides: Int64, num: int, seed: Sequence[int]) -> Float64:
    """Return `num` random places in each square of some pixels: float64 [squares, num, 2], x and y in pixels.

    pixels: int64 [n], numbers of pixels, row by row from the top left corner of a picture of this width.
    sides: int64 [n]; each pixel is divided into side x side equal squares. The squares of the first pixel come first.
    seed: numbers of at least 0. The places in a pixel follow from the seed, its number, its side, and how often it
    comes before in `pixels`.
    """
    nums = sides**2
    owners = np.repeat(np.arange(pixels.size), nums)
    squares = np.arange(owners.size) - np.repeat(np.cumsum(nums) - nums, nums)
    states = states_of(pixels, seed)[owners]
    counters = (2 * num * squares[:, None] + np.arange(1, 2 * num + 1)).astype(np.uint64)
    random = (_mixed(states[:, None] + _STEP * counters) >> _DROPPED_BITS) * _UNIT
    row, column = np.divmod(pixels[owners], width)
    y, x = np.divmod(squares, sides[owners])
    corners, in_pixels = np.stack([column, row], axis=1), np.stack([x, y], axis=1)
    within = (in_pixels[:, None] + random.reshape(-1, num, 2)) / sides[owners, None, None]
    return np.asarray(corners[:, None] + within)


def states_of(pixels: Int64, seed: Sequence[int]) -> UInt64:
    """Return a state of random numbers for each pixel, uint64 [n]; parameters as in `places_in_pixels`."""
    states = _mixed(_mixed_seed(seed) + _STEP * pixels.astype(np.uint64))
    return _mixed(states + _STEP * _repetitions(pixels))


def _repetitions(numbers: Int64) -> UInt64:
    """Return how often each number of an array occurs before it in the array."""
    order = np.argsort(numbers, kind="stable")
    in_order = numbers[order]
    found = np.empty(numbers.size, np.uint64)
    found[order] = np.arange(numbers.size) - np.searchsorted(in_order, in_order)
    return found


def _mixed_seed(seed: Sequence[int]) -> UInt64:
    state = np.zeros(1, np.uint64)
    for number in seed:
        state = _mixed(state + _STEP * np.array([number + 1], np.uint64))
    return state


def _mixed(counters: UInt64) -> UInt64:
    for shift, factor in _MIXING:
        counters = (counters ^ (counters >> shift)) * factor
    return counters
