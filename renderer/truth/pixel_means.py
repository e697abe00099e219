"""Compute what pixels show: the mean over their area of the display-referred colours of exact rays.

A pixel is divided into side x side equal squares, and two rays pass through random places of each. Their mean x has an
error of its own, whose variance v the two rays of each square tell without bias: so (a - x)^2 - v has the expectation
of the squared error of a colour a, however few rays there are. How many a pixel needs is decided by other rays, which
are not used again: a choice by the rays that count would favour the pixels whose rays happen to agree (D. Kirk and
J. Arvo, "Unbiased Sampling Techniques for Image Synthesis", SIGGRAPH 1991).
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

# Squares along a side of a pixel, by the largest difference of a channel among the first rays of the pixel and of its
# eight neighbours, from this difference on. Where an edge crosses a pixel, the sum of variances over a picture is the
# least for its rays if sides grow with the fifth root of a pixel's variance. In frames of eight scans of 256 x 256
# pixels, pictures then have errors of 63 to 69 dB from 10 to 18 rays a pixel.
_SIDES = ((0.0, 1), (0.01, 2), (0.06, 4), (0.34, 8))
# Rays in each square.
RAYS_PER_SQUARE = 2
# Squares along a side for the first rays, one in each: of wires of a tenth of a pixel they miss a sixteenth of the
# pixels; 2 miss a quarter.
_FIRST_SIDE = 3
# The step of the first rays, in voxels: their errors, of 1e-4, are far less than the differences that count.
_FIRST_STEP = 1.0
# Rays that are integrated at once.
_RAYS_AT_ONCE = 2**17
# The part of the whole progress that the first rays take.
_FIRST_SHARE = 0.2

Floats = npt.NDArray[np.floating]


class PixelMeans(NamedTuple):
    """The means of pixels, float [..., 3] in [0, 1], over the background, and the variance of each as an estimate."""

    colors: Floats
    variances: Floats


class MeanPicture(NamedTuple):
    """A picture of means. means: [h, w, 3]. num_rays: of each pixel, int64 [h, w]. is_seen: whether they meet anything.

    convergence: of all rays together.
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
    """Compute the mean over each pixel of a view; a pixel's rays follow from the seed and from its number.

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
    """Return the means of pixels, [n, 3], from the premultiplied RGBA of their rays, in the order of their squares.

    behind: what is behind each pixel, [n, 3]. Rays are put over it and clipped before they are averaged. sides: the
    squares along a side of each pixel.
    """
    nums = sides**2
    colors = _colors_over(radiance, np.repeat(behind, nums * RAYS_PER_SQUARE, axis=0)).reshape(-1, RAYS_PER_SQUARE, 3)
    of_squares = np.stack([colors.mean(axis=1), (colors[:, 0] - colors[:, 1]) ** 2 / 4.0])  # and of their variances
    sums = np.add.reduceat(of_squares, np.cumsum(nums) - nums, axis=1)
    return PixelMeans(sums[0] / nums[:, None], sums[1] / nums[:, None] ** 2)


def _colors_over(radiance: Float64, behind: Float64) -> Float64:
    """Return the display-referred colours of rays, [n, 3]; behind: what is behind each, [n, 3]."""
    return over_rows(radiance[:, None], behind)[:, 0]


def _sides(rays: SceneRays, view: View, behind: Float64, seed: Sequence[int], on_progress: Progress) -> Int64:
    """Return how many squares each pixel needs along its side, int64 [pixels], by a few rays of each."""
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
    """Return the largest value of each pixel and its eight neighbours, [h, w, channels]."""
    padded = np.pad(values, ((1, 1), (1, 1), (0, 0)), mode="edge")
    in_rows = np.maximum(np.maximum(padded[:, :-2], padded[:, 1:-1]), padded[:, 2:])
    return np.asarray(np.maximum(np.maximum(in_rows[:-2], in_rows[1:-1]), in_rows[2:]))


def sides_for(differences: Array, table: Sequence[tuple[float, int]]) -> Int64:
    """Return the side that a table gives from each of some differences on, the first of which is 0; int64 [n]."""
    limits, sides = np.transpose(table)
    return np.asarray(sides[np.searchsorted(limits, differences, side="right") - 1], np.int64)


def _batches(sides: Int64) -> Iterator[tuple[int, Int64]]:
    """Yield pixels that have as many squares as each other, with their side; few enough for their rays at once."""
    for side in np.unique(sides).tolist():
        pixels = np.flatnonzero(sides == side)
        num_at_once = max(1, _RAYS_AT_ONCE // (RAYS_PER_SQUARE * side**2))
        yield from ((side, pixels[first : first + num_at_once]) for first in range(0, pixels.size, num_at_once))


def _together(found: Sequence[Convergence]) -> Convergence:
    """Return the convergence of all rays from those of parts of them, whose steps are the same."""
    steps = max((each.step_voxels for each in found), key=len)
    changes = (max(at_step) for at_step in zip_longest(*(each.change for each in found), fillvalue=0.0))
    nums_rays = (sum(at_step) for at_step in zip_longest(*(each.num_rays for each in found), fillvalue=0))
    return Convergence(steps, tuple(changes), tuple(nums_rays))
