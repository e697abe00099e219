"""Transfer function: scalar value to colour and extinction, piecewise linear and evaluated exactly.

Optical model (Max 1995, "Optical Models for Direct Volume Rendering", emission-absorption): extinction `tau` in
1/length and colour `c`. A scene gives opacity `a` per `unit` of length: `tau = -log1p(-a) / unit`. An opacity of 1 has
no finite extinction, so that `tau` times the finest spacing is capped at MAX_VOXEL_DEPTH.

Between two control points colour and extinction are linear in the scalar, outside of all points they are constant, and
two points at one value are a step whose value belongs to the upper side. Nothing is resampled: values are classified by
the segment that they fall into, or, where the data have at most 16 bits, by a table with an entry for each bit pattern.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.scene import ColormapSpec, TransferSpec

Float64 = npt.NDArray[np.float64]

# exp(-40) = 4e-18 is far below half a level of 8 bits, and below the resolution of float64 at 1: opaque in any image.
MAX_VOXEL_DEPTH = 40.0

# Numbers below two to this have finite differences.
LARGEST_EXPONENT = 1022

# Colormaps are published as 256 samples of a smooth curve.
NUM_COLORMAP_SAMPLES = 256


@dataclass(frozen=True)
class TransferFunction:
    """Control points of a piecewise linear map.

    values: float64 [n], not descending; data units.
    colors: float64 [n, 3] in [0, 1].
    extinctions: float64 [n], >= 0; 1 / world unit.
    unit: the world length that the opacities of the scene refer to.
    """

    values: Float64
    colors: Float64
    extinctions: Float64
    unit: float

    @property
    def max_extinction(self) -> float:
        """The largest extinction anywhere; 1 / world unit."""
        return float(self.extinctions.max())

    @property
    def scale(self) -> float:
        """The power of two, 1 but for the largest control values, with which their differences are finite."""
        return math.ldexp(1.0, min(0, LARGEST_EXPONENT - _binary_exponent(self.values)))

    def classify(self, scalars: npt.NDArray[Any]) -> tuple[Float64, Float64]:
        """Colours float64 [..., 3] and extinctions float64 [...] of scalars of any real dtype and shape."""
        starts, widths, lows, rises = self.segments()
        s = scalars.astype(np.float64)
        k = np.searchsorted(self.values, s, side="right")
        t = (np.clip(s, self.values[0], self.values[-1]) * self.scale - starts[k]) / widths[k]
        result = lows[k] + t[..., None] * rises[k]
        return result[..., :3], result[..., 3]

    def segments(self) -> tuple[Float64, Float64, Float64, Float64]:
        """The same map as n + 1 segments: starts [n + 1], widths [n + 1], values at the start [n + 1, 4] and their rise
        over the segment [n + 1, 4], of (colour, extinction), all float64; starts and widths are times `scale`.

        Segment k holds the scalars from control point k - 1 to point k; the first and the last are constant.
        """
        points = np.column_stack([self.colors, self.extinctions])
        scaled = self.values * self.scale
        starts = np.concatenate([scaled[:1], scaled])
        lows = np.concatenate([points[:1], points])
        rises = np.zeros_like(lows)
        rises[1:-1] = np.diff(points, axis=0)
        widths = np.ones_like(starts)
        widths[1:-1] = np.diff(scaled)
        # A step has no width; no scalar falls into its segment, and 1 keeps the division defined.
        widths[widths == 0] = 1.0
        return starts, widths, lows, rises


def make_transfer_function(spec: TransferSpec, finest_spacing: float) -> TransferFunction:
    """The transfer function of a scene for a volume whose finest spacing is `finest_spacing` world units."""
    unit = finest_spacing if spec.unit is None else spec.unit
    cap = MAX_VOXEL_DEPTH / finest_spacing

    def extinction(opacity: Float64) -> Float64:
        with np.errstate(divide="ignore", over="ignore"):  # the infinite extinction of opacity 1 meets the cap
            return np.minimum(-np.log1p(-opacity) / unit, cap) + 0.0  # -0.0 + 0.0 is 0.0

    if isinstance(spec.mapping, ColormapSpec):
        values, opacities = np.array(spec.mapping.opacity, np.float64).T
        return TransferFunction(*_colormap_control_points(spec.mapping, values, extinction(opacities)), unit)
    values = np.array([point.value for point in spec.mapping], np.float64)
    colors = np.array([point.color for point in spec.mapping], np.float64)
    opacities = np.array([point.opacity for point in spec.mapping], np.float64)
    return TransferFunction(values, colors, extinction(opacities), unit)


def _binary_exponent(values: npt.ArrayLike) -> int:
    """Of the power of two above the largest magnitude."""
    return math.frexp(float(np.abs(values).max()))[1]


def _colormap_control_points(spec: ColormapSpec, at: Float64, extinctions: Float64) -> tuple[Float64, Float64, Float64]:
    """Control points wherever the colormap or the extinction (given at the values `at`) has one."""
    from renderer.scene import colormap_points

    first, last = spec.range
    scale = math.ldexp(
        1.0, min(-1 - _binary_exponent(spec.range), 1000)
    )  # to [-1/2, 1/2], where slopes are finite, too
    # Once each where the range has fewer numbers than the colormap has samples, with the colour of their own place.
    samples = np.unique(np.linspace(first * scale, last * scale, NUM_COLORMAP_SAMPLES) / scale)
    table = np.asarray(colormap_points(spec.name, NUM_COLORMAP_SAMPLES), np.float64)
    extra = samples[~np.isin(samples, at)]  # where both have a point the one of the extinction stays: it may be a step
    values = np.concatenate([extra, at])
    order = np.argsort(values, kind="stable")
    opaque = TransferFunction(at, np.zeros((len(at), 3)), extinctions, 1.0)
    merged = np.concatenate([opaque.classify(extra)[1], extinctions])[order]
    share = (np.clip(values[order], first, last) * scale - first * scale) / (last * scale - first * scale)
    shares = np.linspace(0, 1, NUM_COLORMAP_SAMPLES)
    colors = np.column_stack([np.interp(share, shares, table[:, channel]) for channel in range(3)])
    return values[order], colors, merged
