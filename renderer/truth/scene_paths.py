"""Compute the exact colours of pixels of a scene whose matter scatters light, by paths, as pictures show them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from renderer.film import behind_rows
from renderer.frame import Stage
from renderer.lighting import sources_of
from renderer.scene import Background
from renderer.truth.integrator import Convergence, Progress, ignore
from renderer.truth.optics import TrueLayer
from renderer.truth.path_tracer import PathTracer
from renderer.truth.pixel_light import PATHS_PER_RAY, PixelLight, light_of_pixels
from renderer.truth.pixel_means import MeanPicture, PixelMeans
from renderer.view import View
from renderer.volume import Float64, Int64

# The most paths of a pixel of a converged picture.
_MOST_PATHS = 2**20


class ScenePaths:
    """The paths of a stage's scene, which has `light`: they compute the means over pixels in any view."""

    def __init__(self, stage: Stage, *, num_threads: int = 2) -> None:
        assert stage.scene.light is not None and stage.groups[0].light is not None, "of a scene with light"
        layers = [
            TrueLayer(each.volume, each.optics, weight=each.spec.weight, clip=each.spec.clip) for each in stage.layers
        ]
        self._tracer = PathTracer(layers, sources_of(stage.scene.light), num_threads=num_threads)
        self._exposure = 2.0 ** stage.groups[0].light.stops

    def means(self, view: View, pixels: Int64, behind: Float64, *, num_paths: int, seed: Sequence[int]) -> PixelMeans:
        """Return the means of pixels, by at most so many paths in each; they may be a little above 1.

        pixels: int64 [n], their numbers, row by row; a pixel may come several times. behind: float64 [n, 3], the
        background behind each, in linear light. seed: as of `light_of_pixels`.
        """
        each, first, places = np.unique(pixels, return_index=True, return_inverse=True)
        view = self._without_exposure(view)
        light = light_of_pixels(self._tracer, view, each, seed=seed, standard_error=0.0, most_paths=num_paths)
        shown = light.shown(behind[first], self._exposure)
        return PixelMeans(shown.colors[places], shown.variances[places])

    def converge(
        self,
        view: View,
        background: Background,
        standard_error: float,
        *,
        seed: Sequence[int],
        on_progress: Progress = ignore,
    ) -> MeanPicture:
        """Return the whole picture with about a standard error, which is the root of the mean variance of its pixels.

        The standard error is that of colours as they are shown, from 0 to 1.
        """
        view = self._without_exposure(view)
        width, height = view.size
        pixels = np.arange(width * height)
        behind = np.repeat(behind_rows(background, height, is_linear=True), width, axis=0)

        def error_of(light: PixelLight) -> float:
            return float(np.sqrt(light.shown(behind, self._exposure).variances.mean()))

        light = light_of_pixels(
            self._tracer, view, pixels, seed=seed, standard_error=standard_error, most_paths=_MOST_PATHS,
            error_of=error_of, on_progress=on_progress,
        )  # fmt: skip
        shown = light.shown(behind, self._exposure)
        colors, variances = (np.reshape(each, (height, width, 3)) for each in shown)
        num_rays = np.full((height, width), light.num_paths // PATHS_PER_RAY)
        is_seen = (light.colors[:, 3] > 0).reshape(height, width)
        return MeanPicture(PixelMeans(np.minimum(colors, 1.0), variances), num_rays, is_seen, Convergence((), (), ()))

    def _without_exposure(self, view: View) -> View:
        """Return the view with the colour of its fog divided by the exposure, by which all light is multiplied."""
        if view.fog is None:
            return view
        red, green, blue = (part / self._exposure for part in view.fog.color)
        return replace(view, fog=view.fog._replace(color=(red, green, blue)))
