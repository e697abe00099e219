"""Compute the ground truth: the emission-absorption integral of the continuous field, in float64 on the CPU.

The scalar is interpolated trilinearly between voxel centres, then classified. The outer half voxel has the nearest
value, and outside [-1/2, n - 1/2] is nothing. Of labels, each point has one of those around it. One ray passes through
each pixel's centre (N. Max, "Optical Models for Direct Volume Rendering", IEEE TVCG 1995):

    C = int c(s) tau(s) exp(-int_0^s tau) ds,    alpha = 1 - exp(-int tau)

with s in world units. Of several layers, weighted extinctions add up, tau = sum w_i tau_i, and c = sum w_i tau_i c_i /
tau; each layer has a grid, a transfer function and light of its own. The kernel `truth_integral.cpp` splits a ray
exactly wherever the integrand is not smooth (cell faces, control values of the transfer functions, grazing light); in
between, the error falls with the eighth power of the step. Verified as in T. Etiene et al., "Verifying Volume Rendering
Using Discretization Error Analysis", IEEE TVCG 2014: against closed forms, against an independent Riemann sum and by
the order of convergence.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from renderer.errors import RenderError
from renderer.kernels import IndexRays, ThreadPool, kernels
from renderer.scene import ShadingSpec
from renderer.transfer import TransferFunction
from renderer.truth.kept_parts import keep_parts, removed_sets
from renderer.truth.optics import TrueLayer, optics_of
from renderer.view import View
from renderer.volume import Float64, Int64, Volume

Progress = Callable[[float], None]

# Few enough to keep every core busy until the end and to stop soon after an interrupt (they take some milliseconds, or
# half a second if each meets a thousand shaded cells), and enough to be worth a task.
_RAYS_PER_TASK = 256
# Fewer rays are shared out among the threads. A task takes some milliseconds: a single one needs no other thread.
_TASKS_PER_THREAD, _MIN_RAYS_PER_TASK = 4, 128
# A transfer function that shows all numbers from 1 on.
_ONES = TransferFunction(np.full(2, 0.5), np.zeros((2, 3)), np.arange(2.0), 1.0)
# The first step, in voxels, and how often it is halved.
_FIRST_STEP, _MAX_HALVINGS = 1.0, 12


@dataclass(frozen=True)
class Convergence:
    """A record of an image's convergence, one entry for each halving of the step.

    step_voxels: the step after the halving. change: the largest difference of a channel of any pixel between this step
        and a step twice as long. num_pixels: how many pixels are integrated at this step; the others converged before.
    """

    step_voxels: tuple[float, ...]
    change: tuple[float, ...]
    num_pixels: tuple[int, ...]


def ignore(_share: float) -> None:
    """Do nothing with the finished share of some work."""


def integrate(
    volume: Volume,
    transfer: TransferFunction,
    view: View,
    *,
    step_voxels: float,
    shading: ShadingSpec | None = None,
    num_threads: int = 2,
    on_progress: Progress = ignore,
) -> Float64:
    """Return the image, float64 [height, width, 4], premultiplied RGBA, unclipped, row 0 at the top.

    step_voxels: the longest quadrature step, in voxels of the index axes and in optical depth. Pieces shorter than a
        voxel and thinner than a depth of 1 are also cut into 1 / step_voxels, so that halving it refines every piece.
        Without shading, 1 is already accurate to about 1e-7 (CT scans of an engine and a tree).
    shading: as in `TrueLayer`. num_threads: the image does not depend on it.
    on_progress: called in the caller's thread with the finished share of the rays, in (0, 1]. What it raises ends the
        work, as an interrupt does: rays that have not started are dropped.
    """
    width, height = view.size
    integrator = RayIntegrator([TrueLayer(volume, transfer, shading)], num_threads=num_threads)
    return integrator.integrate(view, np.arange(width * height), [step_voxels], on_progress).reshape(height, width, 4)


class RayIntegrator:
    """An integrator of rays through layers, in any view. It remembers which parts of the volumes show nothing.

    adds: whether the light of all points adds up, as of fluorescence, C = int c(s) tau(s) ds, and nothing hides what is
        behind it. Colours may then exceed 1. Alpha remains 1 - exp(-int tau): how much of a background is hidden.
    """

    def __init__(self, layers: Sequence[TrueLayer], *, adds: bool = False, num_threads: int = 2) -> None:
        self._integrate = kernels().integrate_rays.partial(layers=[optics_of(one) for one in layers], adds=adds)
        self._layers, self._num_threads = tuple(layers), num_threads
        self._centre = np.mean([layer.volume.centre for layer in layers], axis=0)

    def integrate(
        self,
        view: View,
        pixels: Int64,
        steps: Sequence[float],
        on_progress: Progress = ignore,
        done: float = 0.0,
        *,
        by_interval: bool = False,
    ) -> Float64:
        """Return premultiplied RGBA of pixels with each of some steps in voxels, float64 [steps, n, 4].

        by_interval: [steps, n, 4 + m]; the others are what each interval of the transfer function adds to the opacity,
            its transmittance times opacity: below the first of the m - 1 control points, between two, above the last;
            of several layers, one layer behind the other, and shares of an opacity are those of its optical depth.
        pixels: numbered row by row from the top left corner. done: the finished share of the whole work, of which these
        pixels are the rest. Other parameters as in the function `integrate`.
        """
        num_channels = 4 + by_interval * sum(len(layer.transfer.values) + 1 for layer in self._layers)
        radiance, max_steps = np.empty((pixels.size, len(steps), num_channels)), np.array(steps)

        def integrate_part(part: slice) -> None:
            self._require_unchanged()
            rays = [self._rays_of(each, view.clipped(each.clip), pixels[part]) for each in self._layers]
            self._integrate(rays=rays, max_steps=max_steps, radiance=radiance[part])

        in_parts(integrate_part, pixels.size, self._num_threads, lambda share: on_progress(done + share * (1.0 - done)))
        self._require_unchanged()
        return np.moveaxis(radiance, 1, 0)

    def _rays_of(self, layer: TrueLayer, view: View, pixels: Int64) -> IndexRays:
        rays, lit = index_rays(layer.volume, view, pixels, self._centre), layer.shading
        has_faces = lit is not None and lit.cut_faces and layer.volume.colors is None
        return rays._replace(removed=removed_sets(layer.volume, view)) if has_faces else rays

    def _require_unchanged(self) -> None:
        for layer in self._layers:
            layer.volume.require_unchanged()

    def converge(
        self, view: View, pixels: Int64, tolerance: float, on_progress: Progress = ignore
    ) -> tuple[Float64, Convergence]:
        """Integrate pixels at ever shorter steps, until halving the step changes no channel by `tolerance` or more.

        Without shading, one such halving is enough. The integrand of a piece is then a polynomial times the exponential
        of a polynomial, over at most a voxel and an optical depth of 1, and each halving divides the error by 256: the
        change is the error of the coarser result, and the finer one, which is returned, is far better. With shading,
        the integrand has a square root, whose singularities may lie near the ray. One agreement can then be an
        accident, which was seen to leave an error of thirty times the tolerance: two in a row are required.

        on_progress: as in `integrate`. The share is that of the rays that are known to be needed: it falls when pixels
            need one more halving.
        Returns premultiplied RGBA, float64 [n, 4], and the convergence. Raises RenderError where a pixel does not
        converge.
        """
        num_agreements = 2 if any(layer.shading is not None for layer in self._layers) else 1
        remaining = np.arange(pixels.size)  # those that have not converged
        agreements = np.zeros(pixels.size, np.int64)  # in a row
        radiance = np.full((pixels.size, 4), np.inf)  # agrees with nothing
        # Every pixel needs these; together they take little longer than one.
        steps = [_FIRST_STEP / 2**num_halvings for num_halvings in range(_MAX_HALVINGS + 1)]
        first = steps[: num_agreements + 1]
        changes, counts, num_done = [], [], 0
        for at_once in (first, *([step] for step in steps[len(first) :])):
            num_needed = num_done + remaining.size
            for finer in self.integrate(view, pixels[remaining], at_once, on_progress, num_done / num_needed):
                change = np.abs(finer - radiance[remaining]).max(axis=1)
                changes.append(float(change.max()))
                counts.append(remaining.size)
                radiance[remaining] = finer
                agreements = np.where(change < tolerance, agreements + 1, 0)
            num_done = num_needed
            is_open = agreements < num_agreements
            remaining, agreements = remaining[is_open], agreements[is_open]
            if remaining.size == 0:
                return radiance, Convergence(tuple(steps[1 : len(counts)]), tuple(changes[1:]), tuple(counts[1:]))
        in_a_row = " at two halvings in a row" * (num_agreements - 1)
        of_how_many = f"{remaining.size} of {len(radiance)} pixels"
        raise RenderError(
            f"the ray integral does not converge in {_MAX_HALVINGS} halvings of its step",
            where=", ".join(layer.volume.name for layer in self._layers),
            got=f"a change of {changes[-1]:.3g} at a step of {steps[-1]:.3g} voxels; {of_how_many} have not converged",
            expected=f"a change below {tolerance:g}{in_a_row}",
            hint="ask for a larger tolerance",
        )


def in_parts(work: Callable[[slice], None], num_rays: int, num_threads: int, on_progress: Progress) -> None:
    """Work on parts of some rays, on several threads where there are many; what `on_progress` raises ends the work."""
    shared_out = max(_MIN_RAYS_PER_TASK, num_rays // (_TASKS_PER_THREAD * num_threads))
    size = min(_RAYS_PER_TASK, shared_out)
    parts = [slice(first, first + size) for first in range(0, max(num_rays, 1), size)]
    with ThreadPool(num_threads if len(parts) > 1 else 1) as pool, closing(pool.each(work, parts)) as finished:
        for number, _ in enumerate(finished, 1):
            on_progress(number / len(parts))


def index_rays(volume: Volume, view: View, pixels: Int64, point_world: Float64 | None = None) -> IndexRays:
    """Return the rays through the centres of pixels, without the sets that are clipped away.

    point_world: as of `rays_through_pixels`, the volume's centre if it is None.
    """
    point = volume.centre if point_world is None else point_world
    index_from_world = np.asarray(np.linalg.inv(volume.world_from_index[:3, :3]), np.float64)
    origins, directions, starts = rays_through_pixels(point, view, pixels)
    parts = keep_parts(view, point, origins, directions, starts)
    if volume.mask is not None:  # lengths along rays are those of the world in all grids
        parts = _parts_inside(volume.mask, index_rays(volume.mask, view, pixels, point))
    origins = (origins + (point - volume.centre)) @ index_from_world.T + volume.centre_index
    return IndexRays(origins, directions @ index_from_world.T, parts, removed=())


def _parts_inside(mask: Volume, rays: IndexRays) -> Float64:
    """Return what is inside of a mask of the parts of rays, which are in its index space."""
    layer = TrueLayer(mask, _ONES)
    num_rays, room, needed = len(rays.parts), 0, 4
    while needed > room:
        room = needed
        parts, counts = np.zeros((num_rays, room, 2)), np.empty(num_rays, np.int64)
        kernels().mask_rays(layer=optics_of(layer), rays=rays, parts=parts, counts=counts)
        needed = int(counts.max(initial=0))
    return np.ascontiguousarray(parts[:, :needed])


def rays_through_pixels(point_world: Float64, view: View, pixels: Int64) -> tuple[Float64, Float64, Float64]:
    """Return the rays through the centres of pixels, which are numbered row by row from the top left corner.

    Each ray begins at the plane through the point that faces the camera, which preserves precision for a distant eye;
    in perspective not behind the eye.
    Returns origins, relative to the point and in world axes, and unit directions, float64 [n, 3]; and float64 [n]: the
    length along each ray to the plane at depth `view.near`, below 0 if that comes first.
    """
    width, height = view.size
    point = view.view_from_world(point_world)
    depth = max(0.0, -point[2])
    row, column = np.divmod(pixels, width)
    x = (column + 0.5 - width / 2) / view.scale_px
    y = (height / 2 - row - 0.5) / view.scale_px
    if view.projection == "orthographic":
        origins = np.stack([x, y, np.full_like(x, -depth)], axis=1) - point
        return origins @ view.axes, np.broadcast_to(view.forward, origins.shape), np.full(x.shape, view.near - depth)
    direction = np.stack([x, y, np.full_like(x, -1.0)], axis=1)
    length = np.linalg.norm(direction, axis=1)  # world length per unit of depth
    origins = depth * direction - point
    return origins @ view.axes, direction / length[:, None] @ view.axes, (view.near - depth) * length
