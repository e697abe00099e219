"""Compute the exact colours of a few pixels: by exact rays or, where matter scatters light, by paths.

A pixel is an area: its exact colour is the mean over it. The mean has a variance of its own, which is estimated without
bias, and subtracted from the squared error of the pixel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np

from renderer.accuracy.visibility import scalar_ranges, sum_ranges
from renderer.frame import Stage
from renderer.truth import (
    RAYS_PER_SQUARE,
    PixelMeans,
    ScenePaths,
    SceneRays,
    means_over,
    places_in_pixels,
    sides_for,
)
from renderer.view import View
from renderer.volume import Float64, Int64

# The step of exact rays through layers without shading, in voxels: it leaves errors of 1e-7.
_STEP = 1.0
# The step of exact rays if a layer is shaded, in voxels. It left errors of 1e-5 to 1.3e-4 (RMS over the pixels that
# were chosen in seven scans), a tenth of the error of a picture with 58 dB.
_SHADED_STEP = 0.5
# Pairs of a difference and the number of squares along a side of a pixel from this difference on; two rays pass through
# each square. The difference is the largest one of a channel among the pixel and its eight neighbours, in levels of 8
# bits. With equal numbers of rays, estimates for antialiased frames of eight scans had 9 times the deviation with one
# square in every pixel, 1.8 times with 2 x 2, and 1.3 times with 4 x 4.
_SIDES = ((0, 1), (8, 2), (51, 4))
# The number of paths in a pixel.
PATHS_PER_PIXEL = 64


class SeenPixels(NamedTuple):
    """Some pixels of a picture, each of which may come several times.

    numbers: int64 [n], row by row from the top left corner. differences: int64 [n], as `surrounding_differences`.
    behind: float64 [n, 3], the background behind each pixel; in linear light if the scene has `light`.
    """

    numbers: Int64
    differences: Int64
    behind: Float64


class PixelTruth(Protocol):
    """The interface of an object that computes exact colours of pixels. The seed decides the rays or paths."""

    def means(self, view: View, pixels: SeenPixels, seed: Sequence[int]) -> PixelMeans:
        """Return the means over pixels, [n, 3]."""

    def visible(self, view: View, pixels: SeenPixels, shares: Float64, seed: Sequence[int]) -> Visible:
        """Return the means over pixels, and the visibility of ranges. shares: float64 [n], of each pixel."""


class Visible(NamedTuple):
    """The exact colours of pixels, and the opacity that each of the `scalar_ranges` adds to them, by their shares.

    There are no ranges in modes that show a number of a ray in place of light, and of rays that converge.
    """

    means: PixelMeans
    ranges: tuple[float, ...]


def open_truth(stage: Stage, tolerance: float | None, num_threads: int) -> PixelTruth:
    """Return the object that computes exact colours of a stage's pixels.

    tolerance: the largest change of a channel at which exact rays count as converged; None to integrate rays once, with
        a fixed step. Paths have no step.
    """
    if stage.scene.light is None:
        return _RayTruth(stage, tolerance, num_threads)
    return _PathTruth(stage, num_threads)


class _RayTruth:
    """The exact colours of pixels by exact rays."""

    def __init__(self, stage: Stage, tolerance: float | None, num_threads: int) -> None:
        self._tolerance, self._rays = tolerance, SceneRays(stage, num_threads=num_threads)
        is_lit = any(layer.spec.shading is not None for layer in stage.layers)
        self._step = _SHADED_STEP if is_lit else _STEP
        self._ranges = scalar_ranges(stage)

    def means(self, view: View, pixels: SeenPixels, seed: Sequence[int]) -> PixelMeans:
        """Return the means over pixels, [n, 3]."""
        sides, places = self._places(view, pixels, seed)
        if self._tolerance is None:
            return means_over(self._rays.integrate(view, places, self._step), pixels.behind, sides)
        return means_over(self._rays.converge(view, places, self._tolerance)[0], pixels.behind, sides)

    def visible(self, view: View, pixels: SeenPixels, shares: Float64, seed: Sequence[int]) -> Visible:
        """Return the means over pixels, and the visibility of ranges, as PixelTruth says."""
        if self._tolerance is not None:
            return Visible(self.means(view, pixels, seed), ())
        sides, places = self._places(view, pixels, seed)
        exact, by_interval = self._rays.integrate_by_interval(view, places, self._step)
        num_rays = RAYS_PER_SQUARE * sides**2
        ranges = sum_ranges(np.einsum("i,ij->j", np.repeat(shares / num_rays, num_rays), by_interval), self._ranges)
        return Visible(means_over(exact, pixels.behind, sides), ranges)

    def _places(self, view: View, pixels: SeenPixels, seed: Sequence[int]) -> tuple[Int64, Float64]:
        """Return the number of squares along the side of each pixel, and the places of the rays."""
        sides = sides_for(pixels.differences, _SIDES)
        places = places_in_pixels(pixels.numbers, view.size[0], sides, RAYS_PER_SQUARE, seed)
        return sides, places.reshape(-1, 2)


class _PathTruth:
    """The exact colours of pixels by paths of light. Exact rays, which need no light, find the visible ranges."""

    def __init__(self, stage: Stage, num_threads: int) -> None:
        self._paths = ScenePaths(stage, num_threads=num_threads)
        # Albedos have more control points than the scene's colours, whose ranges are recorded; opacities are the same.
        plain = tuple(replace(layer, optics=layer.transfer) for layer in stage.layers)
        self._rays = _RayTruth(replace(stage, layers=plain), None, num_threads)

    def means(self, view: View, pixels: SeenPixels, seed: Sequence[int]) -> PixelMeans:
        """Return the means over pixels, [n, 3]."""
        return self._paths.means(view, pixels.numbers, pixels.behind, num_paths=PATHS_PER_PIXEL, seed=seed)

    def visible(self, view: View, pixels: SeenPixels, shares: Float64, seed: Sequence[int]) -> Visible:
        """Return the means over pixels, and the visibility of ranges, as PixelTruth says."""
        return self._rays.visible(view, pixels, shares, seed)._replace(means=self.means(view, pixels, seed))
