"""Find the parts of rays that the clip planes and boxes of a view leave, and the sets of points that they remove.

Lengths along rays are in units of the world.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from renderer.kernels import RemovedSet
from renderer.scene import ClipSpec
from renderer.view import View
from renderer.volume import Float64, Volume

# A list of sets of points that are clipped away: the lengths at which each of n rays enters and leaves a set, float64
# [n] each; both are infinity for a ray that does not meet the set.
Ranges = list[tuple[Float64, Float64]]


def removed_sets(volume: Volume, view: View) -> list[RemovedSet]:
    """Return the sets of points that the planes and boxes of a view clip away, in a volume's index space.

    A box that is inverted, and so clips away its outside, is replaced by six planes, one for each face.
    """
    found, everywhere = [], np.full(3, np.inf)
    world_from_index = volume.world_from_index[:3]
    for each in view.clip:
        axes, origin = (view.axes, view.target) if each.fixed == "camera" else (np.eye(3), np.zeros(3))
        own_from_index = axes @ world_from_index - np.column_stack([np.zeros((3, 3)), axes @ origin])
        if each.box is not None and not each.invert:
            found.append(RemovedSet(own_from_index, axes.T, *np.array(each.box)))
            continue
        planes = [] if each.plane is None else [(each.plane.point, np.array(each.plane.normal) * (-1) ** each.invert)]
        if each.box is not None:
            planes = [(each.box[end], (2 * end - 1) * np.eye(3)[axis]) for end, axis in product(range(2), range(3))]
        for point, normal in planes:
            along = np.outer([1.0, 0.0, 0.0], normal / np.linalg.norm(normal))
            from_index = along @ (own_from_index - np.column_stack([np.zeros((3, 3)), point]))
            found.append(RemovedSet(from_index, (along @ axes).T, np.append(0.0, -everywhere[1:]), everywhere))
    return found


def keep_parts(view: View, point_world: Float64, origins: Float64, directions: Float64, starts: Float64) -> Float64:
    """Return the parts of rays that clipping leaves, one behind the other: float64 [n, k, 2], some of them empty.

    origins, directions: float64 [n, 3], in world axes; origins are relative to `point_world`. starts: float64 [n], the
    lengths along rays at which they begin.
    """
    ranges: Ranges = []
    for each in view.clip:
        if each.fixed == "camera":
            own_origins = origins @ view.axes.T + view.axes @ (point_world - view.target)
            ranges += _clipped_ranges(each, own_origins, directions @ view.axes.T)
        else:
            ranges += _clipped_ranges(each, origins + point_world, directions)
    never = np.full(len(starts), np.inf)
    begins = np.column_stack([*(begin for begin, _ in ranges), never])
    ends = np.column_stack([*(end for _, end in ranges), never])
    order = np.argsort(begins, axis=1)
    begins, ends = np.take_along_axis(begins, order, axis=1), np.take_along_axis(ends, order, axis=1)
    behind = np.maximum.accumulate(np.column_stack([starts, ends[:, :-1]]), axis=1)
    return np.stack([behind, begins], axis=2)


def _clipped_ranges(clip: ClipSpec, origins: Float64, directions: Float64) -> Ranges:
    """Return the ranges of rays that a plane or a box clips away.

    origins, directions: float64 [n, 3], in the axes, and from the origin, in which the plane or the box is given.
    """
    if clip.plane is not None:
        normal = np.array(clip.plane.normal) * (-1.0 if clip.invert else 1.0)
        first, last = _ranges_above((origins - clip.plane.point) @ normal, directions @ normal)
        return [(first, last)]
    low, high = np.array(clip.box)
    inside = [_ranges_above(*line) for line in ((origins - low, directions), (high - origins, -directions))]
    first = np.maximum(*(begin for begin, _ in inside)).max(axis=1)
    last = np.minimum(*(end for _, end in inside)).min(axis=1)
    is_met = first < last
    first, last = np.where(is_met, first, np.inf), np.where(is_met, last, np.inf)
    never = np.full_like(first, np.inf)
    return [(-never, first), (last, never)] if clip.invert else [(first, last)]


def _ranges_above(heights: Float64, slopes: Float64) -> tuple[Float64, Float64]:
    """Return where straight lines begin and end to be above 0; two infinities for a line that never is.

    heights: of the lines at the position 0. slopes: their rise per unit of length.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        at = np.where(slopes == 0.0, np.where(heights > 0.0, -np.inf, np.inf), -heights / slopes)
    return np.where(slopes < 0.0, -np.inf, at), np.where(slopes < 0.0, at, np.inf)
