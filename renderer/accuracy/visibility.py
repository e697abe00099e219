"""Choose the ranges of scalars whose visibility in pictures is recorded: the ranges of a visibility histogram.

The visibility of a range is, for each ray, the sum of transmittance times opacity over the pieces of the ray whose
scalars lie in the range (C. D. Correa and K.-L. Ma, "Visibility Histograms and Visibility-Driven Transfer Functions",
IEEE TVCG 2011).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.frame import FilmStage
from renderer.layers import Layer
from renderer.scene import LabelStyle
from renderer.transfer import TransferFunction
from renderer.volume import Float64

# The largest number of ranges of scalars of a picture, which its volumes share: a colormap with its 256 control points
# would have too many.
_MOST_RANGES = 12
# The largest number of ranges of labels of a picture, which its volumes share: up to this many labels have a range
# each.
_MOST_LABELS = 48


class ScalarRange(NamedTuple):
    """A range of scalars whose visibility is recorded.

    low, high: low <= scalar < high; either may be infinite.
    opacity: the largest opacity in the range, per unit of the transfer function.
    first: the number of the first interval between control points in the range, counted through all layers.
    name: the labels whose values lie between `low` and `high`, in words; None if scalars are no labels.
    layer: the number of the volume; None for the only volume.
    """

    low: float
    high: float
    opacity: float
    first: int
    name: str | None = None
    layer: int | None = None


def scalar_ranges(stage: FilmStage) -> list[ScalarRange]:
    """Return the ranges of a stage's layers, layer by layer, ascending; none if the mode shows a number, not light."""
    found, first, num = list[ScalarRange](), 0, len(stage.layers)
    for number, layer in enumerate(() if stage.scene.is_projection else stage.layers):
        place = number if num > 1 else None
        found += [each._replace(first=first + each.first, layer=place) for each in _ranges_of(layer, num)]
        first += len(layer.optics.values) + 1
    return found


def _ranges_of(layer: Layer, num_layers: int) -> list[ScalarRange]:
    labels = layer.spec.transfer_function.labels
    if labels is None:
        most = max(1, _MOST_RANGES // num_layers)
        return visible_ranges(layer.transfer, *layer.volume.value_range(), most=most)
    styles, most = labels.styles, max(1, _MOST_LABELS // num_layers)
    return [_of_labels(each, styles) for each in visible_ranges(layer.transfer, 0, len(styles), most=most)]


def _of_labels(numbers: ScalarRange, styles: Sequence[LabelStyle]) -> ScalarRange:
    """Return the range of the values of labels. numbers: the range of the numbers, from 1 on, that stand for them."""
    first, last = styles[max(1, round(numbers.low + 0.5)) - 1], styles[min(len(styles), round(numbers.high - 0.5)) - 1]
    names = [f"label {each.value}" + f" ({each.name})" * bool(each.name) for each in (first, last)]
    name = " to ".join(dict.fromkeys(names))
    return numbers._replace(low=first.value - 0.5, high=last.value + 0.5, name=name)


def visible_ranges(
    transfer: TransferFunction, lowest: float, highest: float, *, most: int = _MOST_RANGES
) -> list[ScalarRange]:
    """Return the ranges between control points in which scalars of a volume may be visible, ascending.

    If there are more than `most`, all visible scalars are divided into `most` equal parts, and the ranges whose middles
    lie in one part are joined. lowest, highest: the smallest and the largest scalar of the volume.
    """
    ends = np.concatenate([[-np.inf], transfer.values, [np.inf]])
    extinctions = np.pad(transfer.extinctions, 1, mode="edge")  # the extinctions at the ends of intervals
    is_opaque = np.maximum(extinctions[:-1], extinctions[1:]) > 0
    is_met = (ends[:-1] <= highest) & (lowest < ends[1:]) & (ends[:-1] < ends[1:])
    visible = np.flatnonzero(is_opaque & is_met)
    parts = np.arange(visible.size)
    if visible.size > most:
        finite = np.clip(np.clip(ends, lowest, highest), transfer.values[0], transfer.values[-1])
        finite /= 4  # sums and differences do not overflow
        low, high = finite[visible[0]], finite[visible[-1] + 1]
        middles = (finite[visible] + finite[visible + 1]) / 2
        parts = np.minimum((middles - low) / (high - low) * most, most - 1).astype(np.int64)
    # Scalars beyond the first or last control point join the range beside it: often there are no such scalars.
    is_inner = (visible[:-1] > 0) & (visible[1:] < transfer.values.size)
    is_new = (np.diff(parts) > 0) & (is_inner | (np.diff(visible) > 1))
    groups = np.split(visible, np.flatnonzero(is_new) + 1) if visible.size else []
    opacities = -np.expm1(-extinctions * transfer.unit)
    spans = [(int(group[0]), int(group[-1]) + 1) for group in groups]
    return [
        ScalarRange(float(ends[first]), float(ends[end]), float(opacities[first : end + 1].max()), first)
        for first, end in spans
    ]


def sum_ranges(by_interval: Float64, ranges: Sequence[ScalarRange]) -> tuple[float, ...]:
    """Return the visibility of each range: the sum over its intervals.

    by_interval: float64 [intervals], the visibility of each interval between control points; 0 for one in no range.
    """
    firsts = np.array([each.first for each in ranges], np.int64)
    return tuple(np.add.reduceat(by_interval, firsts).tolist())
