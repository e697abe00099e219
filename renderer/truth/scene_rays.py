"""Compute the exact rays of a scene: what its mode shows of the continuous field."""

from __future__ import annotations

import math

import numpy as np

from renderer.frame import Stage
from renderer.kernels import kernels
from renderer.modes import Projection
from renderer.transfer import NO_LIGHT_GRID, TransferFunction, make_transfer_function
from renderer.truth.integrator import Convergence, Progress, RayIntegrator, ignore, in_parts, index_rays
from renderer.truth.optics import TrueLayer, for_macrocells, largest_magnitude_scale, readable_values
from renderer.view import View
from renderer.volume import Float64, Int64, Volume

# Of projections by depth: of two maxima that differ by less than this share of the colour range, the nearer one counts.
_LEAST_RISE = 2.0**-18


class SceneRays:
    """A bundle of exact rays of a stage's scene, in any view, as premultiplied RGBA."""

    def __init__(self, stage: Stage, *, num_threads: int = 2) -> None:
        scene, volume = stage.scene, stage.volume
        self._volume, self._projection = volume, stage.projection
        self._search: ExtremeSearch | None = None
        if self._projection is not None and scene.mode.is_extremum:
            self._search = ExtremeSearch(volume, self._projection, num_threads=num_threads)
        else:
            light_grid = NO_LIGHT_GRID if stage.bricks is None else stage.bricks.light_grid
            optics = make_transfer_function(scene.transfer_function, volume.finest_spacing)
            if self._projection is not None:
                optics = self._projection.optics
            layer = TrueLayer(volume, optics, scene.shading, light_grid)
            self._integrator = RayIntegrator([layer], num_threads=num_threads)

    def integrate(self, view: View, pixels: Int64, step_voxels: float) -> Float64:
        """Return the colours of pixels, float64 [n, 4], at one step; parameters as in `RayIntegrator.integrate`."""
        if self._search is not None:
            return self._search.colors(view, pixels)
        return self._colored(view, pixels, self._integrator.integrate(view, pixels, [step_voxels])[0])

    def integrate_by_interval(self, view: View, pixels: Int64, step_voxels: float) -> tuple[Float64, Float64]:
        """Return what `integrate` does, and the `visible` part of each interval of the transfer function.

        visible: float64 [n, intervals], as of `RayIntegrator.integrate`; [n, 0] of projections, which have no opacity.
        """
        if self._projection is not None:
            return self.integrate(view, pixels, step_voxels), np.empty((pixels.size, 0))
        found = self._integrator.integrate(view, pixels, [step_voxels], by_interval=True)[0]
        return found[:, :4], found[:, 4:]

    def converge(
        self, view: View, pixels: Int64, tolerance: float, on_progress: Progress = ignore
    ) -> tuple[Float64, Convergence]:
        """Return the colours of pixels, float64 [n, 4], as `RayIntegrator.converge`; extremes need no steps."""
        if self._search is not None:
            return self._search.colors(view, pixels, on_progress), Convergence((1.0,), (0.0,), (pixels.size,))
        factor = 1.0 if self._projection is None else self._projection.tolerance_factor
        radiance, convergence = self._integrator.converge(view, pixels, factor * tolerance, on_progress)
        return self._colored(view, pixels, radiance), convergence

    def _colored(self, view: View, pixels: Int64, radiance: Float64) -> Float64:
        if self._projection is None:
            return radiance
        return self._projection.exact_colors(radiance, chord_lengths(self._volume, view, pixels))


class ExtremeSearch:
    """A search for the most extreme scalar of rays through a volume. It remembers bounds of the parts of the volume."""

    def __init__(self, volume: Volume, projection: Projection, *, num_threads: int) -> None:
        self._volume, self._projection, self._num_threads = volume, projection, num_threads
        values, spec = readable_values(volume), projection.spec
        self._scale = largest_magnitude_scale(volume, projection.optics)
        self._sign = self._scale if spec.type == "maximum" else -self._scale
        by_depth = spec.color_by == "depth"
        first, last = (end * self._scale for end in projection.color_range)
        self._search = kernels().search_rays.partial(
            values=values,
            tops=for_macrocells(values.shape, np.nan),
            sign=self._sign,
            least_rise=_LEAST_RISE * (last - first) if by_depth else 0.0,
        )

    def colors(self, view: View, pixels: Int64, on_progress: Progress = ignore) -> Float64:
        """Return the colours of pixels, float64 [n, 4]."""
        found = np.empty((pixels.size, 2))

        def search(part: slice) -> None:
            self._volume.require_unchanged()
            self._search(rays=index_rays(self._volume, view, pixels[part]), found=found[part])

        in_parts(search, pixels.size, self._num_threads, on_progress)
        self._volume.require_unchanged()
        chords = chord_lengths(self._volume, view, pixels)
        found[chords == 0] = 0.0
        gathered = np.zeros((pixels.size, 4))
        shares = self._projection.share_of(found[:, 0] / self._sign)
        gathered[:, 0] = shares if self._sign > 0 else 1.0 - shares
        gathered[:, 1] = self._nearness(view, pixels, found[:, 1])
        return self._projection.exact_colors(gathered, chords)

    def _nearness(self, view: View, pixels: Int64, lengths: Float64) -> Float64:
        """Return how near points along rays are: from 0 at the farthest point of the ball around the volume to 1."""
        origins, directions, _ = index_rays(self._volume, view, pixels)
        points = origins + lengths[:, None] * directions - self._volume.centre_index
        depths = points @ self._volume.world_from_index[:3, :3].T @ view.forward
        return np.asarray(0.5 - 0.5 * depths / self._volume.half_diagonal)


def chord_lengths(volume: Volume, view: View, pixels: Int64) -> Float64:
    """Return the world length of rays inside what is left of the volume's box, float64 [n]; 0 where they miss it.

    Of a volume with voxels without data, it is the length inside of the others: an optical depth.
    """
    if volume.num_absent:
        per_length = 1.0 / (2.0 * volume.half_diagonal)
        even = TransferFunction(np.zeros(1), np.ones((1, 3)), np.array([per_length]), 1.0)
        opacities = RayIntegrator([TrueLayer(volume, even)]).integrate(view, pixels, [1.0])[0, :, 3]
        return np.asarray(-np.log1p(-opacities) / per_length)
    origins, directions, parts = index_rays(volume, view, pixels)
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
