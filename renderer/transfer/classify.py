"""Voxels to optical channels, compiled: the transfer function (and shading) applied to a block of voxels or to one.

A voxel's four channels are `(tau c, tau) * h0` with `tau` its extinction, `c` its colour and `h0` the finest spacing:
optical depths of one voxel, without a unit. Where a pyramid averages opacities they are `(a c, a)` with
`a = 1 - exp(-tau h0)`. Extinction-weighted colours are what may be averaged (Wittenbrink, Malzbender, Goss 1998).

Values of at most 16 bits are read as unsigned bit patterns and classified by a table over all of them; wider ones by
the segment of the transfer function that they fall into, exact in float64. A kernel takes the parts of a Classifier as
arguments of its own, where the compiler drops what is None.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.jit import jit
from renderer.scene import ShadingSpec
from renderer.transfer.transfer_function import TransferFunction
from renderer.volume import Volume

RawVoxels = npt.NDArray[Any]
Float64 = npt.NDArray[np.float64]
Channels = tuple[float, float, float, float]

# Depths and opacities below this count as none: a row of 10^10 such voxels would still be invisible, and the mean of
# 2^36 of them with nothing else is still a normal number of float32.
VISIBILITY_THRESHOLD = 2.0**-80

# Buckets from which the search for a segment starts; most hold no control point, and 8 KiB stay in cache.
GUIDE_SIZE = 1024


class TransferSegments(NamedTuple):
    """The transfer function's segments (TransferFunction.segments), with a guide to find them.

    rows: float64 [n + 1, 11], first scalar; start and width times `scale`; values at the start [4], rise [4];
        extinctions times `h0`.
    guide: uint64 [GUIDE_SIZE + 3]; of control values <= a scalar in bucket b there are from guide[b] to guide[b + 3].
    first, last: the range of the control values; scalars are clamped to it.
    scale: TransferFunction.scale.
    buckets_per_unit: buckets of the guide per unit of the scaled scalar.
    opacity: whether the channels are opacities.
    """

    rows: Float64
    guide: npt.NDArray[np.uint64]
    first: float
    last: float
    scale: float
    buckets_per_unit: float
    opacity: bool


class Lighting(NamedTuple):
    """Lambert shading: `light` float64 [3] is the unit vector towards the light in world axes, `world_from_gradient`
    float64 [3, 3] takes a gradient along the index axes to the world."""

    ambient: float
    diffuse: float
    light: Float64
    world_from_gradient: Float64


class Classifier(NamedTuple):
    """What the kernels need to classify a voxel.

    table: float32 [num_patterns, 4], channels by bit pattern; None where segments are evaluated.
    segments: None where there is a table.
    scalars: float64 [num_patterns], the scalar of each pattern; None where voxels are scalars themselves.
    lighting: None without shading.
    """

    table: npt.NDArray[np.float32] | None
    segments: TransferSegments | None
    scalars: Float64 | None
    lighting: Lighting | None


def raw_voxels(volume: Volume) -> RawVoxels:
    """The voxels as the kernels read them: unsigned bit patterns for types of at most 16 bits; no copy is made."""
    size = volume.values.dtype.itemsize
    return volume.values.view({1: np.uint8, 2: np.uint16}[size]) if size <= 2 else volume.values


def make_classifier(
    volume: Volume, transfer: TransferFunction, shading: ShadingSpec | None, *, opacity: bool
) -> Classifier:
    """Prepare classification of this volume's voxels, in opacities or in extinctions."""
    finest_spacing = volume.finest_spacing
    lighting = None
    if shading:
        light = np.array(shading.light, np.float64)
        to_world = np.ascontiguousarray(np.linalg.inv(volume.world_from_index[:3, :3]).T)
        lighting = Lighting(float(shading.ambient), float(shading.diffuse), light / np.linalg.norm(light), to_world)
    dtype = volume.values.dtype
    if dtype.itemsize > 2:
        return Classifier(None, _make_segments(transfer, finest_spacing, opacity), None, lighting)
    patterns = np.arange(1 << 8 * dtype.itemsize, dtype=f"u{dtype.itemsize}").view(dtype)
    scalars = np.nan_to_num(patterns.astype(np.float64), posinf=0.0, neginf=0.0)  # a volume has finite values only
    colors, extinctions = transfer.classify(scalars)
    depths = extinctions * finest_spacing
    weights = -np.expm1(-depths) if opacity else depths
    weights[weights < VISIBILITY_THRESHOLD] = 0.0
    table = np.column_stack([colors * weights[:, None], weights]).astype(np.float32)
    return Classifier(table, None, scalars, lighting)


def _make_segments(transfer: TransferFunction, finest_spacing: float, opacity: bool) -> TransferSegments:
    starts, widths, lows, rises = transfer.segments()
    first_scalars = np.concatenate([transfer.values[:1], transfer.values])
    unit_depth = np.array([1, 1, 1, finest_spacing])
    rows = np.column_stack([first_scalars, starts, widths, lows * unit_depth, rises * unit_depth])
    origin, extent = float(starts[0]), float(starts[-1] - starts[0])
    bounds = np.full(GUIDE_SIZE + 3, np.inf)
    buckets_per_unit = 0.0
    if extent > GUIDE_SIZE * np.finfo(np.float64).tiny:
        # A bucket of slack on both sides, against rounding of the bucket's number in the kernel.
        bounds = origin + extent * ((np.arange(GUIDE_SIZE + 3) - 1) / GUIDE_SIZE)
        buckets_per_unit = GUIDE_SIZE / extent
    bounds[0] = -np.inf  # a scalar below the first control value is clamped into the first bucket
    guide = np.searchsorted(starts[1:], bounds, side="right").astype(np.uint64)
    first, last = float(transfer.values[0]), float(transfer.values[-1])
    return TransferSegments(rows, guide, first, last, transfer.scale, buckets_per_unit, opacity)


@jit
def evaluate(scalar: float, segments: TransferSegments) -> Channels:
    """Channels of a scalar, unlit."""
    rows, guide = segments.rows, segments.guide
    inside = min(max(scalar, segments.first), segments.last) * segments.scale
    # Unsigned indices spare numba asking whether they count from the end.
    bucket = np.uint64(min(int((inside - rows[0, 1]) * segments.buckets_per_unit), GUIDE_SIZE - 1))
    k, most = guide[bucket], guide[bucket + np.uint64(3)]
    while k < most:
        middle = (k + most) >> np.uint64(1)
        if rows[middle + np.uint64(1), 0] <= scalar:
            k = middle + np.uint64(1)
        else:
            most = middle
    t = (inside - rows[k, 1]) / rows[k, 2]
    weight = rows[k, 6] + t * rows[k, 10]
    if segments.opacity:
        weight = -np.expm1(-weight)
    weight = weight if weight >= VISIBILITY_THRESHOLD else 0.0
    return (
        weight * (rows[k, 3] + t * rows[k, 7]),
        weight * (rows[k, 4] + t * rows[k, 8]),
        weight * (rows[k, 5] + t * rows[k, 9]),
        weight,
    )


@jit
def scalar_at(raw: RawVoxels, scalars: Float64 | None, z: int, y: int, x: int) -> float:
    """The scalar of a voxel."""
    if scalars is None:
        return float(raw[z, y, x])
    return float(scalars[raw[z, y, x]])


@jit
def _lighting_factor(raw: RawVoxels, scalars: Float64 | None, lighting: Lighting, z: int, y: int, x: int) -> float:
    """Factor on the colour: ambient + diffuse max(0, n . l), n against the world gradient; ambient where it is 0.

    Derivatives along the index axes are central, one-sided at the border, 0 across one voxel.
    """
    z0, y0, x0 = max(z - 1, 0), max(y - 1, 0), max(x - 1, 0)
    z1, y1, x1 = min(z + 1, raw.shape[0] - 1), min(y + 1, raw.shape[1] - 1), min(x + 1, raw.shape[2] - 1)
    x_low, x_high = scalar_at(raw, scalars, z, y, x0), scalar_at(raw, scalars, z, y, x1)
    y_low, y_high = scalar_at(raw, scalars, z, y0, x), scalar_at(raw, scalars, z, y1, x)
    z_low, z_high = scalar_at(raw, scalars, z0, y, x), scalar_at(raw, scalars, z1, y, x)
    # Only the direction counts, of which the largest part becomes 1. Halves have differences that do not overflow;
    # where those are small the numbers themselves have, too, and no halves, which would round denormals.
    gx, gy, gz = 0.5 * x_high - 0.5 * x_low, 0.5 * y_high - 0.5 * y_low, 0.5 * z_high - 0.5 * z_low
    if max(abs(gx), abs(gy), abs(gz)) < 1.0:
        gx, gy, gz = 2.0 * (x_high - x_low), 2.0 * (y_high - y_low), 2.0 * (z_high - z_low)
    gx, gy, gz = gx / max(x1 - x0, 1), gy / max(y1 - y0, 1), gz / max(z1 - z0, 1)
    largest = max(abs(gx), abs(gy), abs(gz))
    if largest == 0.0:
        return lighting.ambient
    gx, gy, gz = gx / largest, gy / largest, gz / largest
    m, light = lighting.world_from_gradient, lighting.light
    wx = m[0, 0] * gx + m[0, 1] * gy + m[0, 2] * gz
    wy = m[1, 0] * gx + m[1, 1] * gy + m[1, 2] * gz
    wz = m[2, 0] * gx + m[2, 1] * gy + m[2, 2] * gz
    toward_light = -(wx * light[0] + wy * light[1] + wz * light[2]) / np.sqrt(wx * wx + wy * wy + wz * wz)
    return float(lighting.ambient + lighting.diffuse * max(0.0, toward_light))


@jit
def classify_voxel(
    raw: RawVoxels,
    table: npt.NDArray[np.float32] | None,
    segments: TransferSegments | None,
    scalars: Float64 | None,
    lighting: Lighting | None,
    z: int,
    y: int,
    x: int,
) -> Channels:
    """The four channels of one voxel, lit if the scene asks for it."""
    if table is not None:
        pattern = raw[z, y, x]
        r, g, b, a = table[pattern, 0], table[pattern, 1], table[pattern, 2], table[pattern, 3]
    if segments is not None:
        r, g, b, a = evaluate(float(raw[z, y, x]), segments)
    if lighting is not None:
        light = _lighting_factor(raw, scalars, lighting, z, y, x) if a > 0 else 1.0
        r, g, b = r * light, g * light, b * light
    return r, g, b, a
