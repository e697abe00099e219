"""Name labels beside the object: a text for each label in a column at the side, with a line to the label.

The places of texts are the same on all frames, since a text that jumps cannot be read; only the lines move. Each label
has a side and a rank there: of the orders that were tried, the one with the fewest crossings of lines on some frames of
the path. The sides are found before the object is framed, as columns take room; ranks are found again afterwards.

A line ends in the middle of the part of its label that can be seen or, where the picture shows no part of the label
there, at the nearest point that can be seen. All follows from the scene, the layers and the frame, so that frames may
be drawn in any order.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from renderer.annotation.facts import Anchor, Side
from renderer.annotation.seen_borders import are_seen, border_points
from renderer.layers import Layer
from renderer.scene import CameraPath, Color
from renderer.view import View, camera_poses
from renderer.volume import Bools, Float64, Int64

# The largest number of frames of the path on which crossings of lines are counted.
NUM_FRAMES = 16
# The distance of columns, and half their height, in radii of the ball around the labels, where crossings are counted.
_ASIDE, _HALF_HEIGHT = 1.6, 1.0
# The largest share of names at one side.
_MOST_AT_SIDE = 0.6
# The cost of a line as long as the radius, or as a picture is high, in crossings: of orders with equally many
# crossings, that with shorter lines is taken.
_COST_OF_LENGTH = 0.1
# The largest number of exchanges of two names that are tried. 16 names need 700; 89 names took 0.3 ms each.
_MOST_EXCHANGES = 2000


class NamedLabel(NamedTuple):
    """A label with a name, and the place of the name.

    layer, number: the index of the layer, and the number of the label in it. side, rank: the column, and the row in it.
    """

    text: str
    color: Color
    layer: int
    number: int
    side: Side = "left"
    rank: int = 0


# Points on the border of each label of each layer: float64 [n, 3] each, in the world.
LabelPoints = Sequence[Sequence[Float64]]


def label_points(layers: Sequence[Layer]) -> LabelPoints:
    """Return points on the borders of the labels of layers; of a layer without labels, no labels."""
    specs = [layer.spec.transfer_function.labels for layer in layers]
    return [
        [] if spec is None else border_points(layer.volume, len(spec.styles))
        for layer, spec in zip(layers, specs, strict=True)
    ]


def named_labels(
    layers: Sequence[Layer], points: LabelPoints, path: CameraPath, sides: Collection[Side]
) -> list[NamedLabel]:
    """Return the shown labels of all layers that some voxels have, with their places; none without a side.

    layers, points: those of the first frame, and the points on their labels.
    """
    names = list[NamedLabel]()
    for layer, each in enumerate(layers):
        labels = each.spec.transfer_function.labels
        for number, style in enumerate(labels.styles if labels is not None else (), 1):
            if style.opacity > 0 and len(points[layer][number - 1]):
                names.append(NamedLabel(style.name or f"label {style.value}", style.color, layer, number))
    if not names or not sides:
        return []
    ends = _ends_on_path(names, layers, points, path)
    slots = _slots(ends, sides)
    columns = [(side, rank) for side in sides for rank in range(len(slots[side]))]
    order = _order(ends, np.concatenate([slots[side] for side in sides]))
    found = dict(zip(order.tolist(), columns, strict=True))
    placed = [each._replace(side=found[k][0], rank=found[k][1]) for k, each in enumerate(names)]
    return sorted(placed, key=lambda each: (each.side, each.rank))


def ordered_names(
    names: Sequence[NamedLabel],
    starts: Mapping[tuple[Side, int], tuple[float, float]],
    points: LabelPoints,
    layers: Sequence[Layer],
    views: Sequence[View],
) -> list[NamedLabel]:
    """Return names in the order, at each side, in which lines cross least in some views of a framed film.

    starts: the column and the row, in shares of the picture's height, at which the line of each name begins.
    """
    if not names:
        return []
    ends = np.stack([_ends(names, points, layers, view) / view.size[1] for view in views])
    own = np.array([starts[each.side, each.rank] for each in names])
    order = _improved(ends, own, np.arange(len(names)), [each.side for each in names])
    moved = [names[k]._replace(side=each.side, rank=each.rank) for k, each in zip(order, names, strict=True)]
    return sorted(moved, key=lambda each: (each.side, each.rank))


def find_anchors(
    names: Sequence[NamedLabel], points: LabelPoints, layers: Sequence[Layer], view: View, width: int
) -> dict[tuple[Side, int], Anchor]:
    """Return the ends of lines on a frame by side and rank: (column, row), in pixels of a picture of a width.

    Labels of which no point is seen are left out. points: those of the frame's layers, as `label_points` returns them.
    """
    ends = _ends(names, points, layers, view) * (width / view.size[0])
    places = {(each.side, each.rank): end for each, end in zip(names, ends, strict=True)}
    return {key: (float(x), float(y)) for key, (x, y) in places.items() if not np.isnan(x)}


def _ends(names: Sequence[NamedLabel], points: LabelPoints, layers: Sequence[Layer], view: View) -> Float64:
    """Return the ends of lines in a view, float64 [n, 2]: columns and rows; NaN for hidden labels."""
    ends = np.full((len(names), 2), np.nan)
    own = [_points_of(each, points) for each in names]
    if not sum(map(len, own)):
        return ends
    of_name = np.repeat(np.arange(len(names)), [len(each) for each in own])
    owners, all_points = np.array([(each.layer, each.number) for each in names]), np.concatenate(own)
    places, depths = _projected(view, all_points)
    is_seen = ((places >= 0) & (places < view.size)).all(axis=1) & (depths > view.near)
    is_seen[is_seen] = are_seen(layers, view, all_points[is_seen], owners[of_name[is_seen]])
    shown, middles = list[int](), list[Float64]()
    for number in range(len(names)):
        seen = is_seen & (of_name == number)
        if seen.any():
            middle = places[seen].mean(axis=0)
            ends[number] = places[seen][np.argmin(np.hypot(*(places[seen] - middle).T))]
            # The ray through the middle of what is seen begins as far away as the farthest point of the label.
            middles.append(_unprojected(view, middle, depths[of_name == number].max()))
            shown.append(number)
    if shown:
        at_middle = np.array(middles)
        is_on_label = are_seen(layers, view, at_middle, owners[shown])
        ends[np.array(shown)[is_on_label]] = _projected(view, at_middle)[0][is_on_label]
    return ends


def _points_of(name: NamedLabel, points: LabelPoints) -> Float64:
    labels = points[name.layer] if name.layer < len(points) else ()
    return labels[name.number - 1] if name.number <= len(labels) else np.empty((0, 3))


def _projected(view: View, points: Float64) -> tuple[Float64, Float64]:
    """Return the columns and rows of points in a view, float64 [n, 2], and their depths, float64 [n]."""
    in_view = view.view_from_world(points)
    depth = -in_view[:, 2]
    scale = view.scale_px / (
        np.where(depth > 0, depth, 1.0) if view.projection == "perspective" else np.ones_like(depth)
    )
    return view.center_px + scale[:, None] * in_view[:, :2] * (1.0, -1.0), depth


def _unprojected(view: View, place: Float64, depth: float) -> Float64:
    """Return the point in the world at a place in the picture, and at a depth."""
    per_px = (depth if view.projection == "perspective" else 1.0) / view.scale_px
    across, down = (place - view.center_px) * per_px
    return np.asarray(view.target + np.array([across, -down, view.distance - depth]) @ view.axes)


def _ends_on_path(
    names: Sequence[NamedLabel], layers: Sequence[Layer], points: LabelPoints, path: CameraPath
) -> Float64:
    """Return the ends of lines on some frames of a path, float64 [frames, n, 2], NaN for labels that are hidden.

    Columns count to the right and rows down, from the middle of all labels, in radii of the ball around them.
    """
    own = np.concatenate([_points_of(each, points) for each in names])
    centre = (own.min(axis=0) + own.max(axis=0)) / 2
    radius = max(float(np.linalg.norm(own - centre, axis=1).max()), 1e-300)
    frames = np.unique(np.linspace(0, path.frames - 1, NUM_FRAMES).round().astype(int)).tolist()
    views = [
        View(axes, centre, 4 * radius, "orthographic", 1e6 / radius, (3_000_000, 3_000_000))
        for axes in camera_poses(path, frames).axes
    ]
    return np.stack([np.round(_ends(names, points, layers, view) - view.center_px) / 1e6 for view in views])


def _slots(ends: Float64, sides: Collection[Side]) -> dict[Side, Float64]:
    """Return the starts of lines at each side, float64 [n, 2]: as many as labels are seen there in the mean."""
    num, across = ends.shape[1], _mean_over_frames(ends)[:, 0]
    most = int(np.ceil(_MOST_AT_SIDE * num))
    num_left = min(max(int((across < 0).sum()), num - most), most)
    num_right = num - num_left
    if len(sides) == 1:
        num_left = num_right = num
    found = dict[Side, Float64]()
    for side in sides:
        count, column = (num_left, -_ASIDE) if side == "left" else (num_right, _ASIDE)
        rows = _HALF_HEIGHT * ((2 * np.arange(count) + 1) / max(count, 1) - 1)
        found[side] = np.stack([np.full(count, column), rows], axis=1)
    return found


def _mean_over_frames(ends: Float64) -> Float64:
    """Return the mean end of each line over the frames on which it is seen, float64 [n, 2]; 0 without one."""
    is_seen = ~np.isnan(ends[..., 0])
    return np.asarray(np.nansum(ends, axis=0) / np.maximum(is_seen.sum(axis=0), 1)[:, None])


def _order(ends: Float64, starts: Float64) -> Int64:
    """Return the label at each start of a line, int64 [n], so that lines cross seldom.

    Names begin in the order of their mean ends, from side to side and down.
    """
    mean, num = _mean_over_frames(ends), len(starts)
    by_column, order = np.argsort(mean[:, 0], kind="stable"), np.empty(num, np.int64)
    for column in np.unique(starts[:, 0]):
        at_side = np.flatnonzero(starts[:, 0] == column)
        labels = by_column[at_side]
        order[at_side] = labels[np.argsort(mean[labels, 1], kind="stable")]
    return _improved(ends, starts, order, [""] * num)


def _improved(ends: Float64, starts: Float64, order: Int64, groups: Sequence[str]) -> Int64:
    """Return an order with fewer crossings, or shorter lines, found by exchanges of two names of the same group."""
    tried, has_changed = 0, True
    pairs = [[one, other] for one, other in combinations(range(len(starts)), 2) if groups[one] == groups[other]]
    while has_changed and tried < _MOST_EXCHANGES:
        has_changed = False
        for pair in pairs[: _MOST_EXCHANGES - tried]:
            changed = order.copy()
            changed[pair] = order[pair[::-1]]
            if _cost(ends, starts, changed, pair) < _cost(ends, starts, order, pair) - 1e-6:
                order, has_changed = changed, True
        tried += len(pairs)
    return order


def _cost(ends: Float64, starts: Float64, order: Int64, slots: Sequence[int]) -> float:
    """Return the cost of lines from some starts over all frames: their crossings with all lines, and their lengths."""
    placed, cost = ends[:, order], 0.0
    for slot in slots:
        end = placed[:, slot, None]
        cost += float(_cross(starts[slot], end, starts, placed).sum())
        cost += _COST_OF_LENGTH * float(np.nansum(np.hypot(*np.moveaxis(end - starts[slot], -1, 0))))
    return cost


def _cross(start: Float64, end: Float64, other_start: Float64, other_end: Float64) -> Bools:
    """Return which lines cross, bool; lines with a NaN cross none. All are float64 [..., 2], broadcast."""

    def side(a: Float64, b: Float64, c: Float64) -> Float64:
        return np.asarray(
            (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1]) - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
        )

    apart = side(start, end, other_start) * side(start, end, other_end) < 0
    return np.asarray(apart & (side(other_start, other_end, start) * side(other_start, other_end, end) < 0))
