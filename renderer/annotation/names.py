"""Name labels beside the object: a text for each label in a column at the side, with a line to a visible point of it.

The places of texts are the same on all frames: each label has a side and a rank there, by the mean place of its centre
in the pictures along the path. Only the lines move. A line ends at a voxel on the border of its label: of some such
voxels, which are the same on all frames, it is the visible one that is nearest to the label's centre in the picture.
All follows from the scene, the layers and the frame, so that frames may be drawn in any order.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np

from renderer.annotation.facts import Anchor, Side
from renderer.layers import Layer
from renderer.scene import CameraPath, Color
from renderer.view import View, camera_poses
from renderer.volume import Float64, Int64, Volume

# The largest number of voxels of a volume in which labels are looked for. Of larger volumes, every n-th voxel counts.
_MOST_VOXELS = 4_000_000
# The number of voxels on the border of a label that its line may end at.
_NUM_ENDS = 48
# The seed by which these voxels are chosen.
_SEED = 71
# The number of points along a ray at which labels are looked up, from the eye's side of the volume to a voxel.
_NUM_STEPS = 256
# The last part of such a ray, before the voxel itself, in which nothing hides the voxel; in finest spacings.
_NEAR_VOXELS = 2.0
# The number of frames whose mean decides on the side and the rank of a label.
_NUM_FRAMES = 8


class NamedLabel(NamedTuple):
    """A label with a name: its place in a column, and the points in the world at which its line may end.

    side, rank: the column, and the number of the row in it. centre: float64 [3]. ends: float64 [n, 3].
    """

    text: str
    color: Color
    layer: int
    centre: Float64
    ends: Float64
    side: Side = "left"
    rank: int = 0


def named_labels(layers: Sequence[Layer], path: CameraPath, sides: Collection[Side]) -> list[NamedLabel]:
    """Return the labels of all layers with their places in the columns at some sides; none without a side."""
    found = [each for number, layer in enumerate(layers) for each in _labels_of(layer, number)]
    if not found or not sides:
        return []
    poses = camera_poses(path, np.linspace(0, path.frames - 1, _NUM_FRAMES).round().astype(int).tolist())
    right, up = poses.right.mean(axis=0), poses.up.mean(axis=0)
    order = sorted(found, key=lambda each: (float(right @ each.centre), each.text))
    half = len(order) // 2 if len(sides) == 2 else len(order) if "left" in sides else 0
    columns: tuple[tuple[Side, list[NamedLabel]], ...] = ("left", order[:half]), ("right", order[half:])
    return [
        each._replace(side=side, rank=rank)
        for side, column in columns
        for rank, each in enumerate(sorted(column, key=lambda each: -float(up @ each.centre)))
    ]


def find_anchors(
    names: Sequence[NamedLabel], layers: Sequence[Layer], view: View, width: int
) -> dict[tuple[Side, int], Anchor]:
    """Return the ends of lines on a frame by side and rank: (column, row), in pixels of a picture of a width.

    Labels without a visible end are left out.
    """
    found = dict[tuple[Side, int], Anchor]()
    for each in names:
        in_view = view.view_from_world(np.concatenate([each.ends, each.centre[None]]))
        depth = -in_view[:, 2:] if view.projection == "perspective" else np.ones((len(in_view), 1))
        if (depth <= 0).any():
            continue
        places = view.center_px + view.scale_px * in_view[:, :2] * (1.0, -1.0) / depth
        ends, centre = places[:-1], places[-1]
        is_inside = ((ends >= 0) & (ends < view.size)).all(axis=1)
        is_seen = is_inside & ~np.any([_are_hidden(layer, view, each.ends) for layer in layers], axis=0)
        if is_seen.any():
            distances = np.where(is_seen, np.hypot(*(ends - centre).T), np.inf)
            column, row = (ends[int(np.argmin(distances))] * (width / view.size[0])).tolist()
            found[each.side, each.rank] = column, row
    return found


def _labels_of(layer: Layer, number: int) -> list[NamedLabel]:
    """Return the labels of a layer without their places; labels that no sampled voxel has are left out."""
    labels, volume = layer.spec.transfer_function.labels, layer.volume
    if labels is None:
        return []
    step = max(1, round((volume.values.size / _MOST_VOXELS) ** (1 / 3)))
    values = volume.values[::step, ::step, ::step]
    index = np.flatnonzero(values)
    numbers = values.ravel()[index]
    by_number = index[np.argsort(numbers, kind="stable")]
    ends = np.searchsorted(np.sort(numbers, kind="stable"), np.arange(1, len(labels.styles) + 2))
    is_border = _border(values)
    found = []
    for first, last, style in zip(ends[:-1], ends[1:], labels.styles, strict=True):
        own = by_number[first:last]
        if len(own) == 0 or style.opacity == 0:
            continue
        border = own[is_border[own]]
        rng = np.random.default_rng((_SEED, style.value))
        chosen = border[np.sort(rng.permutation(len(border))[:_NUM_ENDS])]
        places = [_to_world(volume, each, values.shape, step) for each in (chosen, own)]
        name = style.name or f"label {style.value}"
        found.append(NamedLabel(name, style.color, number, places[1].mean(axis=0), places[0]))
    return found


def _border(values: np.ndarray) -> np.ndarray:
    """Return which voxels have a neighbour of another value, bool [n] in the order of memory."""
    found = np.zeros(values.shape, np.bool_)
    for axis in range(3):
        moved, border = np.moveaxis(values, axis, 0), np.moveaxis(found, axis, 0)
        differs = moved[1:] != moved[:-1]
        border[1:] |= differs
        border[:-1] |= differs
        border[0] = border[-1] = True
    return found.ravel()


def _to_world(volume: Volume, index: Int64, shape: tuple[int, ...], step: int) -> Float64:
    zyx = np.stack(np.unravel_index(index, shape), axis=1) * step
    return np.asarray(zyx[:, ::-1] @ volume.world_from_index[:3, :3].T + volume.world_from_index[:3, 3])


def _are_hidden(layer: Layer, view: View, points: Float64) -> np.ndarray:
    """Return which points in the world an opaque label of a layer hides in a view, bool [n]."""
    volume, labels = layer.volume, layer.spec.transfer_function.labels
    if labels is None:
        return np.zeros(len(points), np.bool_)
    opaque = np.array([False, *(style.opacity >= 0.5 for style in labels.styles)])
    toward = view.axes[2] if view.projection == "orthographic" else view.eye - points
    length = np.linalg.norm(np.broadcast_to(toward, points.shape), axis=1, keepdims=True)
    reach = np.minimum(length if view.projection == "perspective" else np.inf, 2.0 * volume.half_diagonal)
    near = _NEAR_VOXELS * volume.finest_spacing
    along = near + np.linspace(0.0, 1.0, _NUM_STEPS) * np.maximum(reach - near, 0.0)
    places = points[:, None] + along[..., None] * (toward / length)[:, None]
    index_from_world = np.linalg.inv(volume.world_from_index)
    index = np.rint(places @ index_from_world[:3, :3].T + index_from_world[:3, 3]).astype(np.int64)
    is_inside = ((index >= 0) & (index < volume.shape_xyz)).all(axis=2)
    x, y, z = np.where(is_inside[..., None], index, 0).transpose(2, 0, 1)
    return np.asarray((is_inside & opaque[volume.values[z, y, x]]).any(axis=1))
