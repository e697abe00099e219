"""Compute the exact colours of pixels: the means over their area of the display-referred colours of exact rays.

A pixel is divided into side x side equal squares, and two rays pass through random places of each. The mean x of all
rays has an error of its own, and the two rays of each square give an unbiased estimate v of its variance: so
(a - x)^2 - v has the expectation of the squared error of a colour a, however few rays there are. How many rays a pixel
needs is decided by other rays, which are not used again: a choice by the rays of the mean would favour pixels whose
rays happen to agree (D. Kirk and J. Arvo, "Unbiased Sampling Techniques for Image Synthesis", SIGGRAPH 1991).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.film import behind_rows, over_rows
from renderer.scene import Background
from renderer.truth.integrator import Convergence, Progress, ignore
from renderer.truth.places import places_in_pixels
from renderer.truth.scene_rays import SceneRays
from renderer.view import View
from renderer.volume import Array, Bools, Float64, Int64

# Pairs of a difference and the number of squares along a side of a pixel from this difference on. The difference is the
# largest one of a channel, from 0 to 1, among the first rays of the pixel and of its eight neighbours. For edges, the
# sum of variances over a picture is least, at a given number of rays, if sides grow with the fifth root of a pixel's
# variance. In frames of eight scans of 256 x 256 pixels, pictures then have errors of 63 to 69 dB with 10 to 18 rays a
# pixel.
_SIDES = ((0.0, 1), (0.01, 2), (0.06, 4), (0.34, 8))
# The number of exact rays through each square of a pixel: two, whose difference gives the variance.
RAYS_PER_SQUARE = 2
# The number of squares along a side of a pixel for the first rays, one in each square. With 3, the first rays miss a
# wire a tenth of a pixel wide in a sixteenth of its pixels; with 2, in a quarter.
_FIRST_SIDE = 3
# The step of the first rays, in voxels: their errors, of 1e-4, are far less than the differences in _SIDES.
_FIRST_STEP = 1.0
# At most this many rays are integrated at once, which bounds the memory.
_RAYS_AT_ONCE = 2**17
# The share of the whole progress that the first rays count for.
_FIRST_SHARE = 0.2

Floats = npt.NDArray[np.floating]


class PixelMeans(NamedTuple):
    """Means over the area of pixels.

    colors: float [..., 3], in [0, 1], over the background. variances: of the same shape, the estimated variance of each
    mean.
    """

    colors: Floats
    variances: Floats


class MeanPicture(NamedTuple):
    """An exact picture, whose pixels are means of rays.

    means: [h, w, 3]. num_rays: int64 [h, w], the number of rays of each pixel. is_seen: bool [h, w], whether any of a
    pixel's rays meets something visible. convergence: the record of all rays together.
    """

    means: PixelMeans
    num_rays: Int64
    is_seen: Bools
    convergence: Convergence


def mean_over_pixels(
    rays: SceneRays,
    view: View,
    background: Background,
    tolerance: float,
    *,
    seed: Sequence[int],
    on_progress: Progress = ignore,
) -> MeanPicture:
    """Compute the mean over each pixel of a view. The seed and a pixel's number decide the places of its rays.

    tolerance, on_progress: as in `SceneRays.converge`.
    """
    width, height = view.size
    behind = np.repeat(behind_rows(background, height), width, axis=0)
    sides = _sides(rays, view, behind, (*seed, 0), lambda share: on_progress(_FIRST_SHARE * share))
    num_rays = RAYS_PER_SQUARE * sides**2
    colors, variances = np.empty((2, width * height, 3))
    is_seen, convergences, num_done = np.empty(width * height, np.bool_), list[Convergence](), 0
    for side, pixels in _batches(sides):
        num_new = RAYS_PER_SQUARE * side**2 * pixels.size

        def tell(share: float, begin: int = num_done, num: int = num_new) -> None:
            on_progress(_FIRST_SHARE + (1.0 - _FIRST_SHARE) * (begin + share * num) / num_rays.sum())

        places = places_in_pixels(pixels, width, sides[pixels], RAYS_PER_SQUARE, (*seed, 1))
        radiance, convergence = rays.converge(view, places.reshape(-1, 2), tolerance, tell)
        colors[pixels], variances[pixels] = means_over(radiance, behind[pixels], sides[pixels])
        is_seen[pixels] = (radiance[:, 3] > 0).reshape(pixels.size, -1).any(axis=1)
        convergences.append(convergence)
        num_done += num_new
    means = PixelMeans(colors.reshape(height, width, 3), variances.reshape(height, width, 3))
    shape = (height, width)
    return MeanPicture(means, num_rays.reshape(shape), is_seen.reshape(shape), _together(convergences))


def means_over(radiance: Float64, behind: Float64, sides: Int64) -> PixelMeans:
    """Return the means of n pixels from their rays, which are put over the background and clipped before averaging.

    radiance: [rays, 4], premultiplied RGBA, pixel by pixel and square by square. behind: [n, 3], the background behind
    each pixel. sides: int64 [n], the number of squares along a side of each pixel.
    """
    nums = sides**2
    colors = _colors_over(radiance, np.repeat(behind, nums * RAYS_PER_SQUARE, axis=0)).reshape(-1, RAYS_PER_SQUARE, 3)
    # The mean of the two rays of each square, and the variance of this mean.
    of_squares = np.stack([colors.mean(axis=1), (colors[:, 0] - colors[:, 1]) ** 2 / 4.0])
    sums = np.add.reduceat(of_squares, np.cumsum(nums) - nums, axis=1)
    return PixelMeans(sums[0] / nums[:, None], sums[1] / nums[:, None] ** 2)


def _colors_over(radiance: Float64, behind: Float64) -> Float64:
    """Return the display-referred colours of rays, [n, 3]. behind: [n, 3], the background behind each ray."""
    return over_rows(radiance[:, None], behind)[:, 0]


def _sides(rays: SceneRays, view: View, behind: Float64, seed: Sequence[int], on_progress: Progress) -> Int64:
    """Return how many squares each pixel needs along its side, int64 [pixels], by a few first rays through each."""
    width, height = view.size
    highest, lowest = np.empty((2, width * height, 3))
    batches = [*_batches(np.full(width * height, _FIRST_SIDE))]
    for number, (side, pixels) in enumerate(batches, 1):
        places = places_in_pixels(pixels, width, np.full(pixels.size, side), 1, seed)
        radiance = rays.integrate(view, places.reshape(-1, 2), _FIRST_STEP)
        colors = _colors_over(radiance, np.repeat(behind[pixels], side**2, axis=0)).reshape(pixels.size, -1, 3)
        highest[pixels], lowest[pixels] = colors.max(axis=1), colors.min(axis=1)
        on_progress(number / len(batches))
    tops, bottoms = (_largest_around(each.reshape(height, width, 3)) for each in (highest, -lowest))
    return sides_for((tops + bottoms).max(axis=2).ravel(), _SIDES)


def _largest_around(values: Float64) -> Float64:
    """Return the largest value, in each channel, of each pixel and its eight neighbours: [h, w, channels]."""
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)), mode="edge")
    in_rows = np.maximum(np.maximum(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])
    return np.asarray(np.maximum(np.maximum(in_rows[:-2], in_rows[1:-1]), in_rows[2:]))


def sides_for(differences: Array, table: Sequence[tuple[float, int]]) -> Int64:
    """Return the number of squares along the side of each pixel, int64 [n].

    differences: [n], how much the picture varies around each pixel. table: rows of a difference and the side from this
    difference on, ascending; the first difference is 0.
    """
    limits, sides = np.transpose(table)
    return np.asarray(sides[np.searchsorted(limits, differences, side="right") - 1], np.int64)


def _batches(sides: Int64) -> Iterator[tuple[int, Int64]]:
    """Yield batches of pixels with the same side, after this side: few enough to integrate their rays at once."""
    for side in np.unique(sides).tolist():
        pixels = np.flatnonzero(sides == side)
        num_at_once = max(1, _RAYS_AT_ONCE // (RAYS_PER_SQUARE * side**2))
        yield from ((side, pixels[first : first + num_at_once]) for first in range(0, pixels.size, num_at_once))


def _together(found: Sequence[Convergence]) -> Convergence:
    """Return the convergence of all rays from the convergences of several batches, which have the same steps."""
    steps = max((each.step_voxels for each in found), key=len)
    changes = (max(at_step) for at_step in zip_longest(*(each.change for each in found), fillvalue=0.0))
    nums_rays = (sum(at_step) for at_step in zip_longest(*(each.num_rays for each in found), fillvalue=0))
    return Convergence(steps, tuple(changes), tuple(nums_rays))
