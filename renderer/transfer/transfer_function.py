"""Map scalars to colours and extinctions by a transfer function, which is piecewise linear and evaluated exactly.

Optical model (Max 1995, "Optical Models for Direct Volume Rendering", emission-absorption): extinction `tau` in
1/length and colour `c`. A scene gives opacity `a` per `unit` of length: `tau = -log1p(-a) / unit`. The extinction of
opacity 1 is infinite, so `tau` times the finest spacing is capped at MAX_VOXEL_DEPTH.

Colour and extinction are linear in the scalar between two control points, and constant below the first and above the
last one. Two points at one value are a step, whose value belongs to the upper side. Nothing is resampled.

The min-max test tells whether the transfer function shows anything between two scalars. *Visibility breakpoints* are
the ascending scalars at which visibility changes: a scalar is visible where an odd number of breakpoints is at or below
it. Nothing between two scalars is visible if, and only if, both have the same even number, however thin a peak of the
transfer function is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from renderer.kernels import TransferTable
from renderer.scene import ColormapSpec, LabelsSpec, TransferSpec, colormap_points
from renderer.transfer.piecewise import make_transfer_table
from renderer.volume import Array, Float64

# The largest optical depth of a voxel. The transmittance of such a voxel, exp(-40) = 4e-18, is far below half a step of
# 8 bits, and below the resolution of float64 at 1: the voxel is opaque in any image.
MAX_VOXEL_DEPTH = 40.0

# A voxel whose optical depth or opacity is less than this is invisible, and its channels are 0: a row of 10^10 such
# voxels would still be invisible. The mean of a voxel at the threshold and 2^36 empty voxels is a normal float32.
VISIBILITY_THRESHOLD = 2.0**-80

# Numbers below 2 to the power of this have differences that are finite in float64.
LARGEST_EXPONENT = 1022

# The largest error of interpolating linearly in the scalar in place of its logarithm, as a share of the difference
# between the two points. If the logarithms of the points differ by h, the error is at most h / 8.
MAX_LOG_ERROR = 0.005

# The number of colours that a colormap is sampled with. Most colormaps are published as this many samples.
NUM_COLORMAP_SAMPLES = 256


@dataclass(frozen=True)
class TransferFunction:
    """A transfer function: a piecewise linear map from scalars to colours and extinctions, by its control points.

    values: float64 [n], not descending, in data units.
    colors: float64 [n, 3], in [0, 1].
    extinctions: float64 [n], >= 0, in 1 / world unit.
    unit: the world length to which the opacities of the scene refer.
    """

    values: Float64
    colors: Float64
    extinctions: Float64
    unit: float

    @property
    def max_extinction(self) -> float:
        """Return the largest extinction, in 1 / world unit."""
        return float(self.extinctions.max())

    def curve(self, finest_spacing: float = 1.0) -> TransferTable:
        """Return the transfer function as a table of (r, g, b, extinction times `finest_spacing`)."""
        scale = math.ldexp(1.0, min(0, LARGEST_EXPONENT - _binary_exponent(self.values)))
        curve = make_transfer_table(self.values, np.column_stack([self.colors, self.extinctions]), scale)
        curve.rows[:, [5, 9]] *= finest_spacing
        return curve

    def classify(self, scalars: Array) -> tuple[Float64, Float64]:
        """Return the colours of scalars, float64 [..., 3], and their extinctions, float64 [...].

        scalars: [...], of any real dtype and shape.
        """
        curve, s = self.curve(), scalars.astype(np.float64)
        rows = curve.rows[np.searchsorted(self.values, s, side="right")]
        t = (np.clip(s, self.values[0], self.values[-1]) * curve.scale - rows[..., 0]) / rows[..., 1]
        result = rows[..., 2:6] + t[..., None] * rows[..., 6:]
        return result[..., :3], result[..., 3]


def make_transfer_function(spec: TransferSpec, finest_spacing: float) -> TransferFunction:
    """Return the transfer function of a scene for a volume whose finest spacing is `finest_spacing` world units."""
    unit = finest_spacing if spec.unit is None else spec.unit
    cap = MAX_VOXEL_DEPTH / finest_spacing

    def extinction(opacity: Float64) -> Float64:
        with np.errstate(divide="ignore", over="ignore"):  # the infinite extinction of opacity 1 is capped
            return np.minimum(-np.log1p(-opacity) / unit, cap) + 0.0  # adding 0.0 turns -0.0 into 0.0

    if isinstance(spec.mapping, LabelsSpec):
        # The transfer function of labels has steps half-way between the labels' numbers. Hidden labels have the number
        # 0.
        styles = spec.mapping.styles
        values = np.repeat(np.arange(len(styles) + 1) + 0.5, 2)[:-1]
        opacities = np.append(0.0, np.repeat([style.opacity for style in styles], 2))
        colors = np.vstack([np.zeros((1, 3)), np.repeat([style.color for style in styles], 2, axis=0)])
        return TransferFunction(values, colors, extinction(opacities), unit)
    if isinstance(spec.mapping, ColormapSpec):
        values, opacities = np.array(spec.mapping.opacity, np.float64).T
        points_of = _logarithmic_control_points if spec.mapping.scale == "log" else _colormap_control_points
        return TransferFunction(*points_of(spec.mapping, values, extinction(opacities)), unit)
    values, opacities = np.array([(point.value, point.opacity) for point in spec.points], np.float64).T.copy()
    colors = np.array([point.color for point in spec.points], np.float64)
    return TransferFunction(values, colors, extinction(opacities), unit)


def _binary_exponent(values: npt.ArrayLike) -> int:
    """Return the exponent of a power of two that is above the magnitudes of all values."""
    return math.frexp(float(np.abs(values).max()))[1]


def _colormap_control_points(spec: ColormapSpec, at: Float64, extinctions: Float64) -> tuple[Float64, Float64, Float64]:
    """Return control points that join a colormap's colours and given extinctions: values, colours and extinctions.

    at: the values of the control points of extinctions. extinctions: the extinctions at these values.
    """
    first, last = spec.range
    # The scale brings the range of the colormap into [-1/2, 1/2], where slopes are finite.
    scale = math.ldexp(1.0, min(-1 - _binary_exponent(spec.range), 1000))
    # If the range has fewer numbers than the colormap has samples, each number occurs once, with its own colour.
    samples = np.unique(np.linspace(first * scale, last * scale, NUM_COLORMAP_SAMPLES) / scale)
    table = np.asarray(colormap_points(spec.colormap, NUM_COLORMAP_SAMPLES), np.float64)
    extra = samples[~np.isin(samples, at)]  # a point with an extinction may be a step: it stays
    values = np.concatenate([extra, at])
    order = np.argsort(values, kind="stable")
    opaque = TransferFunction(at, np.zeros((len(at), 3)), extinctions, 1.0)
    merged = np.concatenate([opaque.classify(extra)[1], extinctions])[order]
    share = (np.clip(values[order], first, last) * scale - first * scale) / (last * scale - first * scale)
    shares = np.linspace(0, 1, NUM_COLORMAP_SAMPLES)
    colors = np.column_stack([np.interp(share, shares, table[:, channel]) for channel in range(3)])
    return values[order], colors, merged


def _logarithmic_control_points(
    spec: ColormapSpec, at: Float64, extinctions: Float64
) -> tuple[Float64, Float64, Float64]:
    """Return values, colours and extinctions of control points for a colormap that is linear in the scalar's logarithm.

    Points are added until interpolation in the scalar is within MAX_LOG_ERROR of interpolation in its logarithm. at:
    the values of the control points of extinctions. extinctions: the extinctions at these values.
    """
    logs, ends = np.log(at), np.log(spec.range)
    points = TransferFunction(*_colormap_control_points(replace(spec, range=tuple(ends)), logs, extinctions), 1.0)
    first, last = points.values[0], points.values[-1]
    added = np.linspace(first, last, max(2, math.ceil((last - first) / (8 * MAX_LOG_ERROR))))
    added = added[~np.isin(added, points.values)]
    colors, of_added = points.classify(added)
    values = np.concatenate([points.values, added])
    order = np.argsort(values, kind="stable")
    scalars = np.exp(values)
    scalars[np.flatnonzero(np.isin(values, logs))] = at  # without rounding, as a point may be a step
    return (
        scalars[order],
        np.concatenate([points.colors, colors])[order],
        np.concatenate([points.extinctions, of_added])[order],
    )


def visibility_breakpoints(transfer: TransferFunction, finest_spacing: float) -> Float64:
    """Return the scalars at which a voxel becomes visible or invisible, ascending, float64 [m].

    A slope that rises from 0 becomes visible at the next number of float64, so that the scalar at which the slope
    begins is invisible. The scalar of a step has the visibility of the upper side. Two changes at one scalar cancel.
    """
    values, is_visible = transfer.values, transfer.extinctions * finest_spacing >= VISIBILITY_THRESHOLD
    found = [-math.inf] if is_visible[0] else []
    for k in np.flatnonzero(is_visible[1:] != is_visible[:-1]):
        start, end = float(values[k]), float(values[k + 1])
        low, high = transfer.extinctions[k : k + 2] * finest_spacing
        share = float((VISIBILITY_THRESHOLD - low) / (high - low))
        crossing = start * (1 - share) + end * share
        found.append(min(max(crossing, math.nextafter(start, math.inf)), end))
    different, counts = np.unique(np.array(found, np.float64), return_counts=True)
    return np.asarray(different[counts % 2 == 1])
