"""Lays out the histogram of a volume with its transfer function and its visible values, and slices in its colours."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TypedDict

import numpy as np
from PIL import Image

from hsplat_cli.preview.studio import Shot
from renderer.layers import Layer
from renderer.record import VisibleRange
from renderer.scene import ColormapSpec, format_value
from renderer.statistics import Statistics, compute_statistics, format_percent, rebin
from renderer.view import visible_centre, visible_points
from renderer.volume import Array, Float64, Int64, UInt8, Volume

# Number of bars of a histogram.
_COLUMNS = 160
# Largest number of voxels along each axis whose logarithms a histogram counts.
_MOST_COUNTED = 128
# An index axis lies along an axis of the world if the cosine of the angle between them is at least this.
_ALONG = 1 - 1e-6
# Longer side of a slice, in pixels.
_SLICE_PX = 256


class VolumeChart(TypedDict):
    """Describes a chart and the slices of a layer for the template `preview.html`.

    The chart goes from 0 to 1 across and downwards. name: the name of the layer. bars, curve: SVG paths of the
    histogram and of the opacities. stops: places and colours of the colour scale. ends: the values at both ends of the
    axis. axis: the title of the axis. largest: the largest opacity. unit: the length that opacities belong to. ranges:
    of each visible range of values both ends, its share of the picture, and this share as text. rows: the rows of the
    table of visible values.
    """

    name: str
    bars: str
    curve: str
    stops: list[tuple[str, str]]
    ends: tuple[str, ...]
    axis: str
    largest: str
    unit: str
    ranges: list[tuple[float, float, float, str]]
    rows: list[dict[str, str]]
    slices: list[Shot]


def chart_of(layer: Layer, shown: Sequence[VisibleRange]) -> VolumeChart:
    """Lay out the chart of a layer, and draw its slices. shown: the visible ranges of values of the layer."""
    volume, transfer = layer.volume, layer.transfer
    statistics = compute_statistics(volume.values, volume.source)
    first = _first_of_logarithms(layer)
    counts, edges = rebin(statistics, _COLUMNS) if first is None else _count_logarithms(volume, first)
    low, high = float(edges[0]), float(edges[-1])
    low, high = (low, high) if low < high else (low - 1, high + 1)

    def on_axis(values: Float64) -> Float64:
        return np.clip(values if first is None else np.log10(np.maximum(values, first)), low, high)

    def across(places: Float64) -> Float64:
        # In halves, because the difference of the ends may overflow.
        return (places / 2 - low / 2) / (high / 2 - low / 2)

    even, places = np.linspace(low, high, _COLUMNS), on_axis(transfer.values)
    inner = transfer.values[(places > low) & (places < high)]
    even = even if first is None else 10.0**even
    scalars = np.sort(np.concatenate([even, inner, np.nextafter(inner, -np.inf)]))
    colors, opacities = _classified(layer, scalars)
    heights = np.log1p(counts) / np.log1p(counts.max())
    bars = zip(heights, across(edges[1:]), strict=True)
    curve = zip(across(on_axis(scalars)), 1 - 0.95 * opacities / (opacities.max() or 1.0), strict=True)
    ranges = [] if volume.is_labels else shown
    ends = np.array([(each.low, each.high) for each in ranges], np.float64).reshape(-1, 2)  # with NaN for an open end
    ends = across(np.where(np.isnan(ends), (low, high), on_axis(ends))).tolist()
    return {
        "name": layer.spec.name or Path(volume.name).name,
        "bars": "".join(f"V{1 - height:.4f}H{end:.4f}" for height, end in bars),
        "curve": "L".join(f"{x:.4f} {y:.4f}" for x, y in curve),
        "stops": [
            (f"{x:.4f}", "#" + "".join(f"{round(255 * part):02x}" for part in color))
            for x, color in zip(across(on_axis(scalars)), colors.tolist(), strict=True)
        ],
        "ends": tuple(map(format_value, (statistics.minimum if first is None else first, statistics.maximum))),
        "axis": "shown labels, in their order" if volume.is_labels else "value" + ", logarithmic" * (first is not None),
        "largest": f"{opacities.max():.3g}",
        "unit": f"{transfer.unit:.4g} {volume.length_unit}".strip(),
        "ranges": [(*pair, each.share, format_percent(each.share)) for pair, each in zip(ends, ranges, strict=True)],
        "rows": [*map(_row, shown)],
        "slices": _slices(layer, statistics),
    }


def _first_of_logarithms(layer: Layer) -> float | None:
    """Return the first value of a logarithmic colormap, to which smaller values are raised; None for another scale."""
    mapping = layer.spec.transfer_function.mapping
    return mapping.range[0] if isinstance(mapping, ColormapSpec) and mapping.scale == "log" else None


def _count_logarithms(volume: Volume, first: float) -> tuple[Int64, Float64]:
    """Return counts and edges of a histogram of the decimal logarithms of some of the voxels.

    first: the value to which smaller values are raised.
    """
    z, y, x = (-(-side // _MOST_COUNTED) for side in volume.values.shape)
    values = volume.values[::z, ::y, ::x].astype(np.float64)
    return np.histogram(np.log10(np.maximum(values[np.isfinite(values)], first)), _COLUMNS)


def _row(each: VisibleRange) -> dict[str, str]:
    """Return the row of one visible range in the table of visible values: texts by the titles of columns."""
    ends = [f"{word} {end:.6g}" for word, end in (("from", each.low), ("to", each.high)) if end is not None]
    seen = {"largest\nopacity": f"{each.opacity:.3g}", "seen": format_percent(each.share)}
    return {"values": each.name or " ".join(ends) or "all"} | seen


def _classified(layer: Layer, scalars: Float64) -> tuple[Float64, Float64]:
    """Return the colours of scalars, and their opacities over the transfer function's unit."""
    colors, extinctions = layer.transfer.classify(scalars)
    return colors, -np.expm1(-extinctions * layer.transfer.unit)


def _slices(layer: Layer, statistics: Statistics) -> list[Shot]:
    """Return slices through the middle of the visible part, across x, y and z, each with the later axis upwards."""
    volume, shots = layer.volume, []
    middle = np.array([*visible_centre(visible_points(layer.pyramid)), 1.0])
    nearest = np.round(np.linalg.solve(volume.world_from_index, middle)[:3])
    index = np.asarray(np.clip(nearest, 0, np.array(volume.shape_xyz) - 1), np.float64)
    for axis, (right, up) in enumerate(((1, 2), (0, 2), (0, 1))):
        at = int(index[axis])
        picture = _colored(layer, statistics, np.take(volume.values, at, 2 - axis)[::-1])
        lengths = np.array(picture.shape[1::-1]) * volume.spacing[[right, up]]
        size = tuple(np.maximum(1, np.round(_SLICE_PX * lengths / lengths.max()).astype(int)).tolist())
        pixels = np.asarray(Image.fromarray(picture).resize(size, Image.Resampling.BILINEAR))
        where, seen = _slice_texts(volume, index, axis, right, up)
        shots.append(Shot(where, pixels, seen))
    volume.require_unchanged()
    return shots


def _slice_texts(volume: Volume, index: Float64, axis: int, right: int, up: int) -> tuple[str, str]:
    """Return where a slice across an index axis lies, and what its sides show, with positions in the world.

    index: the indices x, y, z of a voxel in the slice. right, up: the index axes along the sides of the slice.
    """
    slopes = np.abs(volume.world_from_index[:3, :3]) / volume.spacing
    place, voxel = volume.world_from_index[:3] @ [*index, 1.0], f"voxel {'xyz'[axis]} = {index[axis]:.0f}"
    if slopes.max(axis=0).min() < _ALONG:
        through = format_value([float(f"{at:.6g}") for at in place])
        return f"{voxel}, through {through} in the world", f"{'xyz'[right]} to the right, {'xyz'[up]} upwards"
    world_axes = slopes.argmax(axis=0).tolist()

    def ends_text(side: int) -> str:
        along, ends = world_axes[side], (-0.5, volume.shape_xyz[side] - 0.5)
        low, high = (place[along] + (end - index[side]) * volume.world_from_index[along, side] for end in ends)
        return f"world {'xyz'[along]} {low:.6g} to {high:.6g}"

    along = world_axes[axis]
    where = f"{voxel}, world {'xyz'[along]} = {place[along]:.6g} {volume.length_unit}".strip()
    return where, f"{ends_text(right)} to the right, {ends_text(up)} upwards"


def _colored(layer: Layer, statistics: Statistics, values: Array) -> UInt8:
    """Return a slice, uint8 [h, w, 3], in grey, covered by the transfer function's colours.

    The share of the colours is the square root of their opacity, relative to the largest opacity of the slice.
    """
    has_data = np.isfinite(values)
    scalars = np.where(has_data, values, statistics.minimum).astype(np.float64)
    colors, opacities = _classified(layer, scalars)
    share = np.sqrt(opacities / (opacities.max() or 1.0))[..., None]
    low, high = statistics.percentiles[1.0], statistics.percentiles[99.0]
    low, high = (low, high) if low < high else (statistics.minimum, max(statistics.maximum, low + 1))
    grey = np.interp(scalars, (low, high), (0.0, 1.0))[..., None]
    return np.asarray(np.round(255 * has_data[..., None] * (share * colors + (1 - share) * grey)), np.uint8)
