"""Compute the exact colours of rays through a scene, in its mode: light, or another number of a ray."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from renderer.frame import Stage
from renderer.kernels import kernels
from renderer.layers import Layer
from renderer.transfer import TransferFunction
from renderer.truth.integrator import Convergence, Progress, RayIntegrator, ignore, in_parts, index_rays
from renderer.truth.optics import TrueLayer, largest_magnitude_scale, macrocell_counts, voxels_of
from renderer.view import View
from renderer.volume import Float64, Volume

# If the extremum of a ray is coloured by its depth, a maximum replaces a nearer one only if it is larger by at least
# this share of the colour range.
_LEAST_RISE = 2.0**-18


class SceneRays:
    """The exact rays of a stage's scene: they compute the premultiplied RGBA of rays in any view.

    If the scene's mode shows a number of a ray in place of light, each layer is computed by itself, and the colours of
    layers times their weights are added.
    """

    def __init__(self, stage: Stage, *, num_threads: int = 2) -> None:
        layers, self._searches, self._adds = stage.layers, list[ExtremeSearch](), stage.scene.blend == "add"
        self._layers = [layer for layer in layers if layer.projection is not None]
        if stage.scene.mode.is_extremum:
            self._searches = [ExtremeSearch(layer, num_threads=num_threads) for layer in layers]
            return
        alone = bool(self._layers)
        seen = [
            TrueLayer(each.volume, each.optics, spec.shading, each.light_grid, 1.0 if alone else spec.weight, spec.clip)
            for each, spec in ((layer, layer.spec) for layer in layers)
        ]
        bundles = [[layer] for layer in seen] if alone else [seen]
        self._integrators = [RayIntegrator(bundle, adds=self._adds, num_threads=num_threads) for bundle in bundles]

    def integrate(self, view: View, places: Float64, step_voxels: float) -> Float64:
        """Return the colours of rays, float64 [n, 4], with one step; parameters as in `RayIntegrator.integrate`."""
        if self._searches:
            return self._sum([search.gather(view, places) for search in self._searches], view, places)
        return self._sum([each.integrate(view, places, [step_voxels])[0] for each in self._integrators], view, places)

    def integrate_by_interval(self, view: View, places: Float64, step_voxels: float) -> tuple[Float64, Float64]:
        """Return the colours of rays as `integrate`, and the opacity that each interval of scalars adds to each ray.

        The opacities are float64 [n, intervals], as `RayIntegrator.integrate` returns them with `by_interval`; [n, 0]
        in modes that show a number of a ray in place of light, which have no opacity.
        """
        if self._layers:
            return self.integrate(view, places, step_voxels), np.empty((len(places), 0))
        found = self._integrators[0].integrate(view, places, [step_voxels], by_interval=True)[0]
        return self._sum([found[:, :4]], view, places), found[:, 4:]

    def converge(
        self, view: View, places: Float64, tolerance: float, on_progress: Progress = ignore
    ) -> tuple[Float64, Convergence]:
        """Return the converged colours of rays, float64 [n, 4], as `RayIntegrator.converge`.

        The most extreme scalar of a ray is found exactly, without steps: its convergence has one entry, with change 0.
        """
        if self._searches:
            gathered = [search.gather(view, places, on_progress) for search in self._searches]
            return self._sum(gathered, view, places), Convergence((1.0,), (0.0,), (len(places),))
        factors = [layer.projection.tolerance_factor for layer in self._layers if layer.projection is not None] or [1.0]
        found = [
            each.converge(view, places, factor * tolerance, on_progress)
            for each, factor in zip(self._integrators, factors, strict=True)
        ]
        slowest = max((convergence for _, convergence in found), key=lambda each: len(each.step_voxels))
        return self._sum([radiance for radiance, _ in found], view, places), slowest

    def _sum(self, gathered: Sequence[Float64], view: View, places: Float64) -> Float64:
        """Return the colours of rays from the numbers that they gathered.

        gathered: one array for all layers together; one for each layer if the mode shows a number of a ray.
        """
        if not self._layers:
            radiance = gathered[0]
            if self._adds:
                brightest = np.minimum(radiance[:, :3].max(axis=1), 1.0)
                radiance[:, 3] = np.maximum(radiance[:, 3], brightest)
            return radiance
        total = np.zeros((len(places), 4))
        for layer, of_layer in zip(self._layers, gathered, strict=True):
            assert layer.projection is not None
            chords = chord_lengths(layer.volume, view.clipped(layer.spec.clip), places)
            colors = layer.projection.exact_colors(of_layer, chords)
            total += colors * (*[layer.spec.weight] * 3, 1.0)
        total[:, 3] = np.minimum(total[:, 3], 1.0)
        return total


class ExtremeSearch:
    """A search for the most extreme scalar along rays through a layer. It remembers bounds of blocks of the volume."""

    def __init__(self, layer: Layer, *, num_threads: int) -> None:
        volume, projection = layer.volume, layer.projection
        assert projection is not None
        self._layer, self._volume, self._projection, self._num_threads = layer, volume, projection, num_threads
        self._scale = largest_magnitude_scale(volume, projection.optics)
        self._sign = self._scale if projection.spec.type == "maximum" else -self._scale
        by_depth = projection.spec.color_by == "depth"
        first, last = (end * self._scale for end in projection.color_range)
        self._search = kernels().search_rays.partial(
            voxels=voxels_of(volume),
            tops=np.full(macrocell_counts(volume), np.nan),
            sign=self._sign,
            least_rise=_LEAST_RISE * (last - first) if by_depth else 0.0,
        )

    def gather(self, view: View, places: Float64, on_progress: Progress = ignore) -> Float64:
        """Return the numbers that rays through places gather, float64 [n, 4]: those of the mode `Extremum`.

        The first is the place of the most extreme scalar in the colour range, from 0 to 1; the second says how near it
        is, as `_nearness`; two are 0.
        """
        found, view = np.empty((len(places), 2)), view.clipped(self._layer.spec.clip)

        def search(part: slice) -> None:
            self._volume.require_unchanged()
            self._search(rays=index_rays(self._volume, view, places[part]), found=found[part])

        in_parts(search, len(places), self._num_threads, on_progress)
        self._volume.require_unchanged()
        found[np.isinf(found[:, 0])] = 0.0  # a ray that meets nothing
        gathered = np.zeros((len(places), 4))
        shares = self._projection.share_of(found[:, 0] / self._sign)
        gathered[:, 0] = shares if self._sign > 0 else 1.0 - shares
        gathered[:, 1] = self._nearness(view, places, found[:, 1])
        return gathered

    def _nearness(self, view: View, places: Float64, lengths: Float64) -> Float64:
        """Return how near points are: 0 at the farthest point of the ball around the volume, 1 at the nearest.

        lengths: float64 [n], of each point along its ray.
        """
        origins, directions, *_ = index_rays(self._volume, view, places)
        points = origins + lengths[:, None] * directions - self._volume.centre_index
        depths = points @ self._volume.world_from_index[:3, :3].T @ view.forward
        return np.asarray(0.5 - 0.5 * depths / self._volume.half_diagonal)


def chord_lengths(volume: Volume, view: View, places: Float64) -> Float64:
    """Return the world length of rays inside the part of the volume's box that clipping leaves: float64 [n].

    It is 0 for a ray that misses the box. In a volume with voxels without data, only the length inside of voxels with
    data counts: it is computed as an optical depth.
    """
    if volume.num_absent:
        per_length = 1.0 / (2.0 * volume.half_diagonal)
        even = TransferFunction(np.zeros(1), np.ones((1, 3)), np.array([per_length]), 1.0)
        opacities = RayIntegrator([TrueLayer(volume, even)]).integrate(view, places, [1.0])[0, :, 3]
        return np.asarray(-np.log1p(-opacities) / per_length)
    origins, directions, parts, _ = index_rays(volume, view, places)
    low, high = np.full(3, -0.5), np.array(volume.shape_xyz) - 0.5
    with np.errstate(divide="ignore", invalid="ignore"):
        one, other = (low - origins) / directions, (high - origins) / directions
    is_parallel = directions == 0
    is_inside = (origins >= low) & (origins < high)
    enter = np.where(is_parallel, np.where(is_inside, -math.inf, math.inf), np.minimum(one, other)).max(axis=1)
    leave = np.where(is_parallel, math.inf, np.maximum(one, other)).min(axis=1)
    is_met = enter < leave
    enter, leave = np.where(is_met, enter, 0.0), np.where(is_met, leave, 0.0)
    clipped = np.clip(parts, enter[:, None, None], leave[:, None, None])
    return np.asarray(np.maximum(clipped[..., 1] - clipped[..., 0], 0.0).sum(axis=1))
