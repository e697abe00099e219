"""Place the clip planes and boxes of a view in the index space of its rays, as slabs between parallel planes.

A clip plane leaves the half of space on one side, and an inverted box leaves the inside of the box: together they leave
the intersection of several slabs. A box that is not inverted removes the intersection of the slabs across its three
axes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from renderer.kernels import ClipRegion
from renderer.scene import FACE_DEPTH, ClipSpec
from renderer.view.camera import View
from renderer.volume import Bools, Float64, Volume

# A slab, between two parallel planes, is an array [8]. These columns hold the normal of the planes in index space; the
# last three columns hold the normal in the world.
_NORMAL = slice(0, 3)
# The column of a slab's array that holds the lower bound: the position of the first plane along the normal.
_LOW = 3
# The column of a slab's array that holds the upper bound: the position of the second plane along the normal.
_HIGH = 4


def place_clips(volume: Volume, clip: Sequence[ClipSpec], view: View | None = None) -> ClipRegion | None:
    """Return the region of a volume that clip planes and boxes leave; None without planes and boxes.

    view: the view, which is needed only if a plane or a box is fixed to the camera.
    """
    slabs: list[Float64] = [np.empty((0, 8))]
    boxes: list[Float64] = [np.empty((0, 3, 8))]
    for each in clip:
        axes, origin = np.eye(3), np.zeros(3)
        if each.fixed == "camera":
            assert view is not None
            axes, origin = view.axes, np.asarray(view.target)
        centre = axes @ (volume.centre - origin)
        index_from_own = axes @ volume.world_from_index[:3, :3]
        if each.plane is not None:
            normal = np.array(each.plane.normal) / np.linalg.norm(each.plane.normal)
            normal = -normal if each.invert else normal
            height = normal @ (np.array(each.plane.point) - centre)
            slabs.append(np.array([[*(normal @ index_from_own), -np.inf, height, *(normal @ axes)]]))
        else:
            corners = np.array(each.box) - centre
            box = np.column_stack([index_from_own, *corners, axes])
            if each.invert:
                slabs.append(box)
            else:
                boxes.append(box[None])
    return ClipRegion(np.concatenate(slabs), np.concatenate(boxes)) if clip else None


def place_object_clips(volume: Volume, clip: Sequence[ClipSpec]) -> ClipRegion | None:
    """Return the region that clip planes and boxes fixed to the object leave; None without such planes and boxes."""
    return place_clips(volume, [each for each in clip if each.fixed == "object"])


def are_clipped_away(clip: ClipRegion, bounds: Float64) -> Bools:
    """Return which boxes are surely clipped away as a whole, bool [n].

    clip: the region that clipping leaves. bounds: the lowest and the highest corner of each box, in index space
    relative to the volume's centre, float64 [n, 2, 3].
    """
    middles, halves = _middles_and_halves(bounds)
    low, high = _span(clip.slabs, middles, halves)
    is_outside = np.any((high <= clip.slabs[:, _LOW]) | (low >= clip.slabs[:, _HIGH]), axis=1)
    low, high = _span(clip.boxes, middles, halves)
    is_inside = np.all((low >= clip.boxes[..., _LOW]) & (high <= clip.boxes[..., _HIGH]), axis=2)
    return np.asarray(is_outside | np.any(is_inside, axis=1))


def are_near_faces(clip: ClipRegion, volume: Volume, bounds: Float64) -> Bools:
    """Return which boxes of a volume are so near a cut face that they may be lit by the face's normal, bool [n].

    clip: the region that clipping leaves. bounds: the lowest and the highest corner of each box, in index coordinates,
    float64 [n, 2, 3].
    """
    depth, (middles, halves) = FACE_DEPTH * volume.finest_spacing, _middles_and_halves(bounds - volume.centre_index)
    low, high = _span(clip.slabs, middles, halves)
    is_beside = np.any((high > clip.slabs[:, _HIGH] - depth) | (low < clip.slabs[:, _LOW] + depth), axis=1)
    low, high = _span(clip.boxes, middles, halves)
    meets = np.all((low < clip.boxes[..., _HIGH] + depth) & (high > clip.boxes[..., _LOW] - depth), axis=2)
    return np.asarray(is_beside | np.any(meets, axis=1))


def _middles_and_halves(bounds: Float64) -> tuple[Float64, Float64]:
    """Return the middles of boxes and half of their sides, float64 [n, 3] each. bounds: their corners, [n, 2, 3]."""
    return (bounds[:, 0] + bounds[:, 1]) / 2, (bounds[:, 1] - bounds[:, 0]) / 2


def _span(slabs: Float64, middles: Float64, halves: Float64) -> tuple[Float64, Float64]:
    """Return the ends of each box along the normal of each slab, float64 [n, ...] each.

    slabs: [..., 8]. middles, halves: the middles of boxes and half of their sides, [n, 3].
    """
    normals = slabs[..., _NORMAL]
    middle = np.tensordot(middles, normals, (1, -1))
    half = np.tensordot(halves, np.abs(normals), (1, -1))
    return middle - half, middle + half
