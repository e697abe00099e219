"""Find points on the borders of labels, and the points at which a picture shows a given label."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from renderer.layers import Layer
from renderer.view import View, are_clipped_away, place_clips
from renderer.volume import Bools, Float64, Int64, UInt64, Volume, iter_slabs

# The number of points on the border of a label. The mean of 96 points of which a few come and go moves by less than a
# pixel where the label is 60 pixels wide.
_POINTS_OF_LABEL = 96
# The smallest number of points on the border of a label, where labels are many.
_LEAST_POINTS = 8
# The number of points of all labels, so that a frame with many labels takes no longer than one with 42.
_POINTS = 4096
# The number of bytes of voxels that are looked at together. A pass took 5 ns a voxel at 33 million voxels of 104
# labels, and 25 ns at 4 million, where the first slabs, of which more is sorted, count for more.
_SLAB_BYTES = 1 << 20
# The largest number of places along a ray at which labels are looked up: one for each voxel, or fewer in large volumes.
_MOST_STEPS = 256
# The number of places along each ray that are looked up together. Rays that met a label are left out of the next ones.
_BLOCK = 32
# The opacity from which on a label hides labels behind it.
_OPAQUE = 0.5


def border_points(volume: Volume, num_labels: int) -> list[Float64]:
    """Return points on the border of each label, in the world, float64 [n, 3] each; none of a label without voxels.

    The centres of voxels are chosen as if at random, among all voxels of the label that have a neighbour of another
    value: the same voxels on every machine. volume: a volume of the labels 1 to `num_labels`.
    """
    most = min(max(_POINTS // max(num_labels, 1), _LEAST_POINTS), _POINTS_OF_LABEL)
    index, label = _border_voxels(volume, num_labels, most)
    z, y, x = np.unravel_index(index, volume.values.shape)
    affine = volume.world_from_index
    places = np.stack([x, y, z], axis=1) @ affine[:3, :3].T + affine[:3, 3]
    ends = np.searchsorted(label, np.arange(1, num_labels + 2))
    return [places[first:last] for first, last in pairwise(ends)]


def are_seen(layers: Sequence[Layer], view: View, points: Float64, owners: Int64) -> Bools:
    """Return at which points, float64 [n, 3] in the world, a picture shows the label that the point belongs to.

    It does if this label is the first on the way from the eye to the point that is opaque, or the point's own.
    owners: int64 [n, 2], the index of the layer and the number of the label of each point.
    """
    is_own, nearest = np.zeros(len(points), np.bool_), np.full(len(points), -1.0)
    for number, layer in enumerate(layers):
        labels = layer.spec.transfer_function.labels
        if labels is None:
            continue
        is_opaque = np.array([False, *(style.opacity >= _OPAQUE for style in labels.styles)])
        own = np.where(owners[:, 0] == number, owners[:, 1], 0)
        found, distance = _first_labels(layer, view, points, own, is_opaque)
        is_nearer = distance > nearest
        is_own[is_nearer] = (found == own)[is_nearer] & (found > 0)[is_nearer]
        nearest[is_nearer] = distance[is_nearer]
    return is_own


def _border_voxels(volume: Volume, num_labels: int, most: int) -> tuple[Int64, Int64]:
    """Return the index and the label of at most this many voxels on the border of each label, by label."""
    values, plane, first = volume.values, volume.values[0].size, 0
    index, label, key = np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0, np.uint64)
    # Of the voxels of a label, the ones with the smallest keys are kept. last: the largest of these keys, if all places
    # are taken, else the largest number.
    last = np.full(num_labels + 1, np.iinfo(np.uint64).max)
    for slab in iter_slabs(values, volume.source, _SLAB_BYTES):
        before = min(first, 1)
        is_border = _border(values[first - before : first + len(slab) + 1])[before : before + len(slab)]
        new = np.flatnonzero(is_border & (slab > 0))
        new_label, new_key = slab.ravel()[new].astype(np.int64), _mixed(new + first * plane)
        kept = new_key < last[new_label]
        index = np.concatenate([index, new[kept] + first * plane])
        label, key = np.concatenate([label, new_label[kept]]), np.concatenate([key, new_key[kept]])
        order = np.lexsort((key, label))
        rank = np.arange(len(order)) - np.searchsorted(label[order], label[order])
        last[label[order[rank == most - 1]]] = key[order[rank == most - 1]]
        order = order[rank < most]
        index, label, key = index[order], label[order], key[order]
        first += len(slab)
    return index, label


def _border(values: np.ndarray) -> Bools:
    """Return which voxels have a neighbour of another value or none, bool [z, y, x]."""
    found = np.zeros(values.shape, np.bool_)
    for axis in range(3):
        moved, border = np.moveaxis(values, axis, 0), np.moveaxis(found, axis, 0)
        differs = moved[1:] != moved[:-1]
        border[1:] |= differs
        border[:-1] |= differs
        border[0] = border[-1] = True
    return found


def _mixed(index: Int64) -> UInt64:
    """Return numbers that look random, one for each index: the last steps of SplitMix64 (Steele et al. 2014)."""
    key = index.astype(np.uint64)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        key = (key ^ (key >> np.uint64(shift))) * np.uint64(factor)
    return np.asarray(key ^ (key >> np.uint64(31)))


def _first_labels(layer: Layer, view: View, points: Float64, own: Int64, is_opaque: Bools) -> tuple[Int64, Float64]:
    """Return the first label on the way from the eye to each point that is opaque or `own`, and how far it is.

    The label is 0, and the distance -1, where there is none. The distance is that from the point. own: int64 [n].
    """
    volume, clip = layer.volume, place_clips(layer.volume, view.clip + layer.spec.clip, view)
    start, along, length = _ways(volume, view, points)
    steps = np.clip(np.ceil(length / volume.finest_spacing), 1, _MOST_STEPS)
    found, distance, left = np.zeros(len(points), np.int64), np.full(len(points), -1.0), np.flatnonzero(length >= 0)
    for block in range(0, _MOST_STEPS + 1, _BLOCK):
        if not len(left):
            break
        # Steps go from the eye's end of the way to the point, which is the last of them.
        share = np.maximum(1 - (block + np.arange(_BLOCK)) / steps[left, None], 0.0)
        reach = share * length[left, None]
        places = start[left, None] + reach[..., None] * along[left, None]
        index = np.rint(places).astype(np.int64)
        is_inside = ((index >= 0) & (index < volume.shape_xyz)).all(axis=2)
        x, y, z = np.where(is_inside[..., None], index, 0).transpose(2, 0, 1)
        labels = np.where(is_inside, volume.values[z, y, x], 0).astype(np.int64)
        is_hit = is_opaque[labels] | ((labels == own[left, None]) & (labels > 0))
        if clip is not None and is_hit.any():
            offsets = places[is_hit] - volume.centre_index
            is_hit[is_hit] = ~are_clipped_away(clip, np.stack([offsets, offsets], axis=1))
        met, first = is_hit.any(axis=1), np.argmax(is_hit, axis=1)
        rows = np.flatnonzero(met)
        found[left[met]], distance[left[met]] = labels[rows, first[met]], reach[rows, first[met]]
        left = left[~met & (block + _BLOCK <= steps[left])]
    return found, distance


def _ways(volume: Volume, view: View, points: Float64) -> tuple[Float64, Float64, Float64]:
    """Return the way from each point to the eye in index space: its start, its direction, and its length.

    The way ends where it leaves the volume. The direction is per unit of length in the world, in which lengths are.
    """
    toward = np.broadcast_to(view.axes[2] if view.projection == "orthographic" else view.eye - points, points.shape)
    far = np.linalg.norm(toward, axis=1)
    index_from_world = np.linalg.inv(volume.world_from_index)
    start = points @ index_from_world[:3, :3].T + index_from_world[:3, 3]
    along = (toward / np.maximum(far, 1e-300)[:, None]) @ index_from_world[:3, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.where(along > 0, np.array(volume.shape_xyz) - 0.5, -0.5)
        exits = np.where(along == 0, np.inf, (ends - start) / along).min(axis=1)
    return start, along, exits if view.projection == "orthographic" else np.minimum(exits, far)
