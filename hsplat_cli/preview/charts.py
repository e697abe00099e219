"""Lay out the histogram of a volume with its transfer function, what is seen of it, and slices in its colours."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image

from hsplat_cli.preview.studio import Shot
from hsplat_cli.reports import webp_data_uri
from renderer.job import FilmVisibility
from renderer.layers import Layer
from renderer.scene import format_value
from renderer.suggest import Statistics, compute_statistics, format_percent, rebin
from renderer.view import visible_centre, visible_points
from renderer.volume import Array, Float64, UInt8

# Of a histogram and of the shares below it, in pixels of the page.
WIDTH, HEIGHT, SEEN_HEIGHT = 640, 160, 50
_COLUMNS = 160
_SLICE_PX = 256


@dataclass(frozen=True)
class Chart:
    """A chart of a volume, in pixels. bars, curve: paths of counts and opacities. stops: (share, colour).

    ends: of the values. largest: opacity. ranges: (x, width, height, share) of what is seen. rows: the same as a table.
    """

    name: str
    is_labels: bool
    bars: str
    curve: str
    stops: list[tuple[float, str]]
    ends: tuple[str, str]
    largest: str
    unit: str
    ranges: list[tuple[float, float, float, str]]
    rows: list[dict[str, str]]
    slices: list[Shot]


def chart_of(layer: Layer, visibility: FilmVisibility | None) -> Chart:
    """Return the chart and the slices of a layer. visibility: of the scene's only layer."""
    volume, transfer = layer.volume, layer.transfer
    statistics = compute_statistics(volume.values, volume.source)
    counts, edges = rebin(statistics, _COLUMNS)
    low, high = float(edges[0]), float(edges[-1])
    if not low < high:
        low, high = low - 1, high + 1
    inner = transfer.values[(transfer.values > low) & (transfer.values < high)]
    scalars = np.sort(np.concatenate([np.linspace(low, high, _COLUMNS), inner, np.nextafter(inner, low)]))
    colors, opacities = _classified(layer, scalars)
    largest = float(opacities.max())
    across = _across(scalars, low, high)
    return Chart(
        name=layer.spec.name or Path(volume.name).name,
        is_labels=volume.is_labels,
        bars=_bars(counts, _across(edges, low, high)),
        curve=_line(across, HEIGHT * (1 - 0.95 * opacities / (largest or 1.0))),
        stops=[(at / WIDTH, _hex(color)) for at, color in zip(across.tolist(), colors, strict=True)],
        ends=(format_value(statistics.minimum), format_value(statistics.maximum)),
        largest=f"{largest:.3g}",
        unit=f"{transfer.unit:.4g} {volume.length_unit}".strip(),
        ranges=[] if visibility is None or volume.is_labels else [*_ranges(visibility, low, high)],
        rows=_rows(visibility),
        slices=_slices(layer, statistics),
    )


def _ranges(visibility: FilmVisibility, low: float, high: float) -> Iterator[tuple[float, float, float, str]]:
    for each in visibility.ranges:
        ends = (low if each.low is None else each.low, high if each.high is None else each.high)
        first, last = _across(np.clip(ends, low, high), low, high).tolist()
        yield first, last - first, SEEN_HEIGHT * each.share, format_percent(each.share)


def _rows(visibility: FilmVisibility | None) -> list[dict[str, str]]:
    """Return a line for each range of values: its largest opacity, and its share of what is seen."""
    rows = []
    for each in visibility.ranges if visibility is not None else ():
        ends = [word + f"{end:.6g}" for word, end in (("from ", each.low), ("to ", each.high)) if end is not None]
        name = each.name or " ".join(ends) or "all"
        rows.append({"values": name, "largest\nopacity": f"{each.opacity:.3g}", "seen": format_percent(each.share)})
    return rows


def _classified(layer: Layer, scalars: Float64) -> tuple[Float64, Float64]:
    """Return colours, and opacities for the transfer function's unit."""
    colors, extinctions = layer.transfer.classify(scalars)
    return colors, -np.expm1(-extinctions * layer.transfer.unit)


def _across(values: Float64, low: float, high: float) -> Float64:
    return WIDTH * (values / 2 - low / 2) / (high / 2 - low / 2)  # halves, whose differences do not overflow


def _bars(counts: Array, edges: Array) -> str:
    heights = HEIGHT * np.log1p(counts) / np.log1p(counts.max())
    steps = (f"V{HEIGHT - height:.1f}H{end:.1f}" for height, (_, end) in zip(heights, pairwise(edges), strict=True))
    return f"M{edges[0]:.1f} {HEIGHT}{''.join(steps)}V{HEIGHT}Z"


def _line(x: Array, y: Array) -> str:
    return "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))


def _hex(color: Array) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in color.tolist())


def _slices(layer: Layer, statistics: Statistics) -> list[Shot]:
    """Return slices through the middle of what is visible, across x, y and z, each with the last axis upwards."""
    volume, spacing = layer.volume, layer.volume.spacing
    middle = np.array([*visible_centre(visible_points(layer.pyramid)), 1.0])
    index = np.clip(np.round(np.linalg.solve(volume.world_from_index, middle)[:3]), 0, np.array(volume.shape_xyz) - 1)
    shots = []
    for axis, (right, up) in enumerate(((1, 2), (0, 2), (0, 1))):
        at = int(index[axis])
        picture = _colored(layer, statistics, np.take(volume.values, at, 2 - axis)[::-1])
        lengths = np.array([picture.shape[1] * spacing[right], picture.shape[0] * spacing[up]])
        width, height = (max(1, round(side)) for side in _SLICE_PX * lengths / lengths.max())
        pixels = np.asarray(Image.fromarray(picture).resize((width, height), Image.Resampling.BILINEAR))
        names = "xyz"[axis], "xyz"[right], "xyz"[up]
        seen = f"{names[1]} to the right, {names[2]} upwards"
        shots.append(Shot(f"{names[0]} = {at}", webp_data_uri(pixels), (width, height), seen))
    volume.require_unchanged()
    return shots


def _colored(layer: Layer, statistics: Statistics, values: Array) -> UInt8:
    """Return a slice in the colours of the transfer function, by the root of its opacities, over grey."""
    has_data = np.isfinite(values)
    scalars = np.where(has_data, values, statistics.minimum).astype(np.float64)
    colors, opacities = _classified(layer, scalars)
    share = np.sqrt(opacities / (opacities.max() or 1.0))[..., None]
    low, high = statistics.percentiles[1.0], statistics.percentiles[99.0]
    low, high = (low, high) if low < high else (statistics.minimum, statistics.maximum)
    grey = np.interp(scalars, (low, high), (0.0, 1.0))[..., None] if low < high else 0.5
    return np.asarray(np.round(255 * has_data[..., None] * (share * colors + (1 - share) * grey)), np.uint8)
