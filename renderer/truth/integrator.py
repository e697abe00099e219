"""Compute the ground truth: the emission-absorption integral of the continuous field, in float64 on the CPU.

The scalar is interpolated trilinearly between voxel centres, then classified. In the outer half of a border voxel, the
scalar is that of the nearest voxel; beyond indices from -1/2 to n - 1/2 there is nothing. In a volume of labels, each
point has the label of one of the voxels around it. Rays pass through any places in the picture (N. Max, "Optical Models
for Direct Volume Rendering", IEEE TVCG 1995):

    C = int c(s) tau(s) exp(-int_0^s tau) ds,    alpha = 1 - exp(-int tau)

with the colour c and the extinction tau at the distance s along the ray, in units of the world. With several layers,
extinctions times the layers' weights w_i add up: tau = sum w_i tau_i, and c = sum w_i tau_i c_i / tau. Each layer has a
grid, a transfer function and light of its own. The kernel `truth_integral.cpp` splits a ray exactly wherever the
integrand is not smooth (cell faces, control values of the transfer functions, grazing light); in between, the error
falls with the eighth power of the step. The integral is verified as in T. Etiene et al., "Verifying Volume Rendering
Using Discretization Error Analysis", IEEE TVCG 2014: against closed forms, against an independent Riemann sum and by
the order of convergence.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from renderer.errors import RenderError
from renderer.kernels import IndexRays, RayFog, ThreadPool, kernels
from renderer.transfer import TransferFunction
from renderer.truth.kept_parts import keep_parts, removed_sets
from renderer.truth.optics import TrueLayer, optics_of
from renderer.view import View
from renderer.volume import Float64, Volume

# A function that is told the finished share of some work, from 0 to 1.
Progress = Callable[[float], None]

# The most rays of a task. It takes some milliseconds, or half a second if each ray meets a thousand shaded cells: so
# every core is busy until the end, and an interrupt ends the work soon.
_RAYS_PER_TASK = 256
# A few rays are divided into at most this many tasks for each thread, so that all threads have some.
_TASKS_PER_THREAD = 4
# A task has at least this many rays, which take some milliseconds: fewer rays are not worth another thread.
_MIN_RAYS_PER_TASK = 128
# A transfer function that shows all labels except 0, for masks.
_ONES = TransferFunction(np.full(2, 0.5), np.zeros((2, 3)), np.arange(2.0), 1.0)
# The step with which the convergence of rays begins, in voxels.
_FIRST_STEP = 1.0
# The step is halved at most this many times; a ray that has not converged then is an error.
_MAX_HALVINGS = 12


@dataclass(frozen=True)
class Convergence:
    """A record of the convergence of rays, with one entry for each halving of the step.

    step_voxels: the length of the step after the halving, in voxels.
    change: the largest change of a channel of any ray from the step twice as long.
    num_rays: the rays that were integrated with this step; all other rays had converged before.
    """

    step_voxels: tuple[float, ...]
    change: tuple[float, ...]
    num_rays: tuple[int, ...]


def ignore(_share: float) -> None:
    """Do nothing: a Progress for callers who do not want to know the finished share of the work."""


class RayIntegrator:
    """An integrator of rays through layers, in any view. It remembers which parts of the volumes show nothing.

    adds: whether the light of all points adds up, as that of fluorescence does: C = int c(s) tau(s) ds, and no point
        hides points behind it. Colours may then exceed 1. Alpha remains 1 - exp(-int tau), the share of the background
        that is hidden.
    """

    def __init__(self, layers: Sequence[TrueLayer], *, adds: bool = False, num_threads: int = 2) -> None:
        self._integrate = kernels().integrate_rays.partial(layers=[optics_of(one) for one in layers], adds=adds)
        self._layers, self._num_threads = tuple(layers), num_threads
        self._centre = np.mean([layer.volume.centre for layer in layers], axis=0)

    def integrate(
        self,
        view: View,
        places: Float64,
        steps: Sequence[float],
        on_progress: Progress = ignore,
        done: float = 0.0,
        *,
        by_interval: bool = False,
    ) -> Float64:
        """Integrate rays with each of several steps; return premultiplied RGBA, not clipped: float64 [steps, n, 4].

        places: float64 [n, 2], where rays pass through the picture: x and y in pixels from its top left corner.
        steps: the longest quadrature steps, in voxels of the index axes and in optical depth. Pieces of a ray that are
            shorter than a voxel and thinner than a depth of 1 are also divided into 1 / step parts, so that halving the
            step refines every piece. Without shading, a step of 1 is already accurate to about 1e-7 (CT scans of an
            engine and a tree).
        on_progress: called in the caller's thread with the finished share of the work, in (0, 1]. An exception that it
            raises ends the work, as an interrupt does: rays that have not started are dropped.
        done: the share of the work that was finished before this call; these rays are all that remains.
        by_interval: whether to return [steps, n, 4 + m], where the last m numbers are the opacity that each interval of
            the transfer function adds to the ray: its transmittance times opacity. With m - 1 control points, intervals
            are below the first, between two, and above the last. The intervals of several layers come one layer after
            the other, and layers share the opacity at a point in proportion to their optical depths.
        """
        num_channels = 4 + by_interval * sum(len(layer.transfer.values) + 1 for layer in self._layers)
        radiance, max_steps = np.empty((len(places), len(steps), num_channels)), np.array(steps)

        def integrate_part(part: slice) -> None:
            self._require_unchanged()
            rays = [self._rays_of(each, view.clipped(each.clip), places[part]) for each in self._layers]
            fog = fog_along(view, self._centre, places[part])
            self._integrate(rays=rays, max_steps=max_steps, fog=fog, radiance=radiance[part])

        in_parts(integrate_part, len(places), self._num_threads, lambda share: on_progress(done + share * (1.0 - done)))
        self._require_unchanged()
        return np.moveaxis(radiance, 1, 0)

    def _rays_of(self, layer: TrueLayer, view: View, places: Float64) -> IndexRays:
        rays, lit = index_rays(layer.volume, view, places, self._centre), layer.shading
        has_faces = lit is not None and lit.cut_faces and layer.volume.colors is None
        return rays._replace(removed=removed_sets(layer.volume, view)) if has_faces else rays

    def _require_unchanged(self) -> None:
        for layer in self._layers:
            layer.volume.require_unchanged()

    def converge(
        self, view: View, places: Float64, tolerance: float, on_progress: Progress = ignore
    ) -> tuple[Float64, Convergence]:
        """Integrate rays at ever shorter steps, until halving the step changes no channel by `tolerance` or more.

        Without shading, one such halving is enough. The integrand of a piece of a ray is then a polynomial times the
        exponential of a polynomial, over at most a voxel and an optical depth of 1, and each halving divides the error
        by 256: the change is the error of the coarser result, and the finer result, which is returned, is far better.
        With shading, the integrand has a square root, whose singularities may lie near the ray. One agreement can then
        be an accident, which was seen to leave an error of thirty times the tolerance: two in a row are required.

        places, on_progress: as in `integrate`. The finished share is a share of the work that is known to be needed: it
            falls when rays need one more halving.
        Returns premultiplied RGBA, float64 [n, 4], and the convergence. Raises RenderError where a ray does not
        converge.
        """
        num_agreements = 2 if any(layer.shading is not None for layer in self._layers) else 1
        remaining = np.arange(len(places))  # the rays that have not converged
        agreements = np.zeros(len(places), np.int64)  # halvings in a row that changed a ray by less than the tolerance
        radiance = np.full((len(places), 4), np.inf)  # infinite, so that the first result agrees with nothing
        # Every ray needs the first steps; integrating with all of them at once takes little longer than with one.
        steps = [_FIRST_STEP / 2**num_halvings for num_halvings in range(_MAX_HALVINGS + 1)]
        first = steps[: num_agreements + 1]
        changes, counts, num_done = [], [], 0
        for at_once in (first, *([step] for step in steps[len(first) :])):
            num_needed = num_done + remaining.size
            for finer in self.integrate(view, places[remaining], at_once, on_progress, num_done / num_needed):
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
        of_how_many = f"{remaining.size} of {len(radiance)} rays"
        raise RenderError(
            f"the ray integral does not converge in {_MAX_HALVINGS} halvings of its step",
            where=", ".join(layer.volume.name for layer in self._layers),
            got=f"a change of {changes[-1]:.3g} at a step of {steps[-1]:.3g} voxels; {of_how_many} have not converged",
            expected=f"a change below {tolerance:g}{in_a_row}",
            hint="ask for a larger tolerance",
        )


def in_parts(work: Callable[[slice], None], num_rays: int, num_threads: int, on_progress: Progress) -> None:
    """Call `work` with slices that together have all rays; many rays are shared among threads.

    An exception that `on_progress` raises ends the work.
    """
    shared_out = max(_MIN_RAYS_PER_TASK, num_rays // (_TASKS_PER_THREAD * num_threads))
    size = min(_RAYS_PER_TASK, shared_out)
    parts = [slice(first, first + size) for first in range(0, max(num_rays, 1), size)]
    with ThreadPool(num_threads if len(parts) > 1 else 1) as pool, closing(pool.each(work, parts)) as finished:
        for number, _ in enumerate(finished, 1):
            on_progress(number / len(parts))


def index_rays(volume: Volume, view: View, places: Float64, point_world: Float64 | None = None) -> IndexRays:
    """Return the rays through places in a picture, in the index space of a volume; `removed` is left empty.

    places: float64 [n, 2], as in `rays_through`. point_world: the point at whose plane rays begin, as in
        `rays_through`; None for the volume's centre.
    """
    point = volume.centre if point_world is None else point_world
    index_from_world = np.asarray(np.linalg.inv(volume.world_from_index[:3, :3]), np.float64)
    origins, directions, starts = rays_through(point, view, places)
    parts = keep_parts(view, point, origins, directions, starts)
    if view.fog is not None:  # the share of fog is smooth within each of the parts
        parts = _split_at_fog(parts, fog_along(view, point, places))
    if volume.mask is not None:  # its parts fit, as lengths along rays are world lengths in all grids
        parts = _parts_inside(volume.mask, index_rays(volume.mask, view, places, point))
    origins = (origins + (point - volume.centre)) @ index_from_world.T + volume.centre_index
    return IndexRays(origins, directions @ index_from_world.T, parts, removed=())


def fog_along(view: View, point_world: Float64, places: Float64) -> RayFog | None:
    """Return the fog along rays through places in a picture; None for a view without fog.

    point_world: the point at whose plane rays begin, as in `rays_through`.
    """
    if view.fog is None:
        return None
    origins, directions, _ = rays_through(point_world, view, places)
    return RayFog(
        np.array(view.fog.color), np.column_stack(view.fog_share(view.fog, origins + point_world, directions))
    )


def _split_at_fog(parts: Float64, fog: RayFog | None) -> Float64:
    """Divide parts of rays, [n, k, 2], where the share of fog becomes 0 and 1: [n, 3 k, 2], some of them empty."""
    assert fog is not None
    share, speed = np.asarray(fog.shares).T[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        borders = np.sort(np.concatenate([-share / speed, (1.0 - share) / speed], axis=1), axis=1)
    borders[~np.isfinite(borders)] = 0.0  # a ray across the viewing direction, whose share is even
    low, high = parts[..., 0], parts[..., 1]
    ends = [low, *(np.clip(borders[:, k, None], low, np.maximum(low, high)) for k in range(2)), np.maximum(low, high)]
    pieces = [np.stack(pair, axis=-1) for pair in pairwise(ends)]
    return np.ascontiguousarray(np.stack(pieces, axis=2).reshape(len(parts), -1, 2))


def _parts_inside(mask: Volume, rays: IndexRays) -> Float64:
    """Return the parts of rays that are inside a mask: float64 [n, k, 2], some of them empty.

    rays: in the index space of the mask, with the parts that clipping leaves.
    """
    layer = TrueLayer(mask, _ONES)
    num_rays, room, needed = len(rays.parts), 0, 4
    while needed > room:
        room = needed
        parts, counts = np.zeros((num_rays, room, 2)), np.empty(num_rays, np.int64)
        kernels().mask_rays(layer=optics_of(layer), rays=rays, parts=parts, counts=counts)
        needed = int(counts.max(initial=0))
    return np.ascontiguousarray(parts[:, :needed])


def rays_through(point_world: Float64, view: View, places: Float64) -> tuple[Float64, Float64, Float64]:
    """Return the rays through places in a picture.

    places: float64 [n, 2], x and y in pixels from the top left corner of the picture.
    point_world: each ray begins at the plane through this point that faces the camera, which preserves precision for a
        distant eye; in perspective, it never begins behind the eye.
    Returns the rays' origins, relative to the point and in world axes, and their unit directions, float64 [n, 3]; and
    the length along each ray from its origin to the plane at depth `view.near`, float64 [n]: below 0 if this plane
    comes before the origin.
    """
    (column, row), point = view.center_px, view.view_from_world(point_world)
    depth = max(0.0, -point[2])
    x = (places[:, 0] - column) / view.scale_px
    y = (row - places[:, 1]) / view.scale_px
    if view.projection == "orthographic":
        origins = np.stack([x, y, np.full_like(x, -depth)], axis=1) - point
        return origins @ view.axes, np.broadcast_to(view.forward, origins.shape), np.full(x.shape, view.near - depth)
    direction = np.stack([x, y, np.full_like(x, -1.0)], axis=1)
    length = np.linalg.norm(direction, axis=1)  # the length along a ray for a depth of 1
    origins = depth * direction - point
    return origins @ view.axes, direction / length[:, None] @ view.axes, (view.near - depth) * length
