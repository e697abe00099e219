"""Voxels to optical channels, compiled: the transfer function (and shading) applied to one brick or one voxel.

A voxel's four channels are `(tau c, tau) * h0` with `tau` its extinction, `c` its colour and `h0` the finest spacing:
optical depths of one voxel, without a unit. Where a pyramid averages opacities they are `(a c, a)` with
`a = 1 - exp(-tau h0)`. Extinction-weighted colours are what may be averaged (Wittenbrink, Malzbender, Goss 1998).

Values of at most 16 bits are read as unsigned bit patterns and classified by a table over all of them; wider ones by
the segment of the transfer function that they fall into, found from a coarse guide and exact in float64.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from renderer.scene import ShadingSpec
from renderer.transfer import TransferFunction
from renderer.volume import Volume

# Buckets of the guide to the segments; a transfer function rarely has more points than this, and 4 KiB stay in cache.
GUIDE_SIZE = 1024


class Classifier(NamedTuple):
    """What the kernels need to classify a voxel; a tuple of plain arrays, as numba takes it.

    table: float32 [num_patterns, 4], channels by bit pattern; or [0, 4] where segments are evaluated.
    scalars: float64 [num_patterns], the scalar of each pattern; or [0].
    segments: float64 [m, 10], start, 1 / width, values at the start [4] and rise [4] of TransferFunction.segments,
        extinctions times `h0`.
    guide: int64 [GUIDE_SIZE], the first segment that a bucket of scalars can fall into.
    first, last: float64, the range of the control values; scalars are clamped to it.
    buckets_per_unit: float64, buckets of the guide per unit of the scalar.
    opacity: whether the channels are opacities.
    shaded: whether the colour is lit.
    ambient, diffuse, light: Lambert shading, `light` float64 [3] a unit vector towards the light in world axes.
    world_from_gradient: float64 [3, 3], gradient along index axes to gradient in the world.
    """

    table: npt.NDArray[np.float32]
    scalars: npt.NDArray[np.float64]
    segments: npt.NDArray[np.float64]
    guide: npt.NDArray[np.int64]
    first: float
    last: float
    buckets_per_unit: float
    opacity: bool
    shaded: bool
    ambient: float
    diffuse: float
    light: npt.NDArray[np.float64]
    world_from_gradient: npt.NDArray[np.float64]


def voxel_codes(volume: Volume) -> npt.NDArray[Any]:
    """The voxels as the kernels read them: unsigned bit patterns for types of at most 16 bits; no copy is made."""
    size = volume.values.dtype.itemsize
    return volume.values.view({1: np.uint8, 2: np.uint16}[size]) if size <= 2 else volume.values


def make_classifier(
    volume: Volume, transfer: TransferFunction, shading: ShadingSpec | None, *, opacity: bool
) -> Classifier:
    """Prepare classification of this volume's voxels, in opacities or in extinctions."""
    starts, widths, lows, rises = transfer.segments()
    unit_depth = np.array([1, 1, 1, volume.spacing.min()])
    table, scalars = np.zeros((0, 4), np.float32), np.zeros(0)
    dtype = volume.values.dtype
    if dtype.itemsize <= 2:
        patterns = np.arange(1 << 8 * dtype.itemsize, dtype=f"u{dtype.itemsize}").view(dtype)
        scalars = np.nan_to_num(patterns.astype(np.float64), posinf=0.0, neginf=0.0)  # a volume has finite values only
        colors, extinctions = transfer.classify(scalars)
        depths = extinctions * volume.spacing.min()
        weights = -np.expm1(-depths) if opacity else depths
        table = np.column_stack([colors * weights[:, None], weights]).astype(np.float32)
    first, last = float(transfer.values[0]), float(transfer.values[-1])
    # One bucket early, so that rounding in the kernel's bucket number cannot start the search too late.
    buckets = first + (last - first) * (np.maximum(np.arange(GUIDE_SIZE) - 1, 0) / GUIDE_SIZE)
    guide = np.searchsorted(transfer.values, buckets, side="right")
    light = np.array(shading.light if shading else (0.0, 0.0, 1.0))
    return Classifier(
        table,
        scalars,
        np.column_stack([starts, 1 / widths, lows * unit_depth, rises * unit_depth]),
        guide.astype(np.int64),
        first,
        last,
        GUIDE_SIZE / (last - first) if last > first else 0.0,
        opacity,
        shading is not None,
        shading.ambient if shading else 1.0,
        shading.diffuse if shading else 0.0,
        light / np.linalg.norm(light),
        np.ascontiguousarray(np.linalg.inv(volume.world_from_index[:3, :3]).T),
    )


@numba.njit(inline="always")
def _evaluate(value, segments, guide, first, last, buckets_per_unit, opacity):  # type: ignore[no-untyped-def]
    """Channels of a scalar from its segment, unlit."""
    s = min(max(float(value), first), last)
    k = len(segments) - 1
    if s < last:
        k = guide[min(int((s - first) * buckets_per_unit), GUIDE_SIZE - 1)]
        while segments[k + 1, 0] <= s:
            k += 1
    t = (s - segments[k, 0]) * segments[k, 1]
    weight = segments[k, 5] + t * segments[k, 9]
    if opacity:
        weight = -np.expm1(-weight)
    return (
        weight * (segments[k, 2] + t * segments[k, 6]),
        weight * (segments[k, 3] + t * segments[k, 7]),
        weight * (segments[k, 4] + t * segments[k, 8]),
        weight,
    )


@numba.njit(cache=True, nogil=True, error_model="numpy")
def scalar_of(code, rule):  # type: ignore[no-untyped-def]
    """The scalar behind a code, float64."""
    if rule.scalars.size > 0:
        return rule.scalars[int(code)]
    return float(code)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _difference(codes, rule, z, y, x, axis):  # type: ignore[no-untyped-def]
    """Derivative of the scalar along an index axis (0 is x): central, one-sided at the border, 0 across one voxel."""
    if axis == 0:
        low, high = max(x - 1, 0), min(x + 1, codes.shape[2] - 1)
        rise = scalar_of(codes[z, y, high], rule) - scalar_of(codes[z, y, low], rule)
    elif axis == 1:
        low, high = max(y - 1, 0), min(y + 1, codes.shape[1] - 1)
        rise = scalar_of(codes[z, high, x], rule) - scalar_of(codes[z, low, x], rule)
    else:
        low, high = max(z - 1, 0), min(z + 1, codes.shape[0] - 1)
        rise = scalar_of(codes[high, y, x], rule) - scalar_of(codes[low, y, x], rule)
    return rise / max(high - low, 1)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _lighting(codes, rule, z, y, x):  # type: ignore[no-untyped-def]
    """Factor on the colour: ambient + diffuse max(0, n . l), n against the world gradient; ambient where it is 0."""
    gx = _difference(codes, rule, z, y, x, 0)
    gy = _difference(codes, rule, z, y, x, 1)
    gz = _difference(codes, rule, z, y, x, 2)
    m, light = rule.world_from_gradient, rule.light
    wx = m[0, 0] * gx + m[0, 1] * gy + m[0, 2] * gz
    wy = m[1, 0] * gx + m[1, 1] * gy + m[1, 2] * gz
    wz = m[2, 0] * gx + m[2, 1] * gy + m[2, 2] * gz
    largest = max(abs(wx), abs(wy), abs(wz))
    if largest == 0.0:
        return rule.ambient
    wx, wy, wz = wx / largest, wy / largest, wz / largest  # so that squares neither overflow nor vanish
    toward_light = -(wx * light[0] + wy * light[1] + wz * light[2]) / np.sqrt(wx * wx + wy * wy + wz * wz)
    return rule.ambient + rule.diffuse * max(0.0, toward_light)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def classify_voxel(codes, rule, z, y, x):  # type: ignore[no-untyped-def]
    """The four channels of one voxel, lit if the scene asks for it."""
    code = codes[z, y, x]
    if rule.table.shape[0] > 0:
        p = int(code)
        r, g, b, a = (
            float(rule.table[p, 0]), float(rule.table[p, 1]), float(rule.table[p, 2]), float(rule.table[p, 3]),
        )  # fmt: skip
    else:
        r, g, b, a = _evaluate(code, rule.segments, rule.guide, rule.first, rule.last, rule.buckets_per_unit, rule.opacity)
    if rule.shaded and a > 0.0:
        light = _lighting(codes, rule, z, y, x)
        r, g, b = r * light, g * light, b * light
    return r, g, b, a


@numba.njit(cache=True, nogil=True, error_model="numpy")
def is_visible(codes, rule, z, y, x):  # type: ignore[no-untyped-def]
    """Whether a voxel has any extinction."""
    if rule.table.shape[0] > 0:
        return rule.table[int(codes[z, y, x]), 3] > 0.0
    segments, guide = rule.segments, rule.guide
    weight = _evaluate(codes[z, y, x], segments, guide, rule.first, rule.last, rule.buckets_per_unit, rule.opacity)[3]
    return np.float32(weight) > 0.0


@numba.njit(cache=True, nogil=True, error_model="numpy")
def classify_rows(codes, rule, origin, extent, out):  # type: ignore[no-untyped-def]
    """Channels of the voxels `origin` + [0, extent) (z, y, x) into out[x % 2, z, y, channel, x // 2]; the rest is left alone.

    Even and odd voxels apart, so that pairs of them can be merged as whole vectors.
    """
    table, segments, guide = rule.table, rule.segments, rule.guide
    first, last, buckets_per_unit, opacity = rule.first, rule.last, rule.buckets_per_unit, rule.opacity
    z0, y0, x0 = origin
    block = codes[z0 : z0 + extent[0], y0 : y0 + extent[1], x0 : x0 + extent[2]]
    for z in range(extent[0]):
        for y in range(extent[1]):
            for odd in range(2):
                num = (extent[2] + 1 - odd) // 2
                if rule.shaded:
                    for x in range(num):
                        r, g, b, a = classify_voxel(codes, rule, z0 + z, y0 + y, x0 + 2 * x + odd)
                        out[odd, z, y, 0, x], out[odd, z, y, 1, x] = r, g
                        out[odd, z, y, 2, x], out[odd, z, y, 3, x] = b, a
                elif table.shape[0] > 0:
                    for x in range(num):
                        p = int(block[z, y, 2 * x + odd])
                        out[odd, z, y, 0, x], out[odd, z, y, 1, x] = table[p, 0], table[p, 1]
                        out[odd, z, y, 2, x], out[odd, z, y, 3, x] = table[p, 2], table[p, 3]
                else:
                    for x in range(num):
                        code = block[z, y, 2 * x + odd]
                        r, g, b, a = _evaluate(code, segments, guide, first, last, buckets_per_unit, opacity)
                        out[odd, z, y, 0, x], out[odd, z, y, 1, x] = r, g
                        out[odd, z, y, 2, x], out[odd, z, y, 3, x] = b, a


@numba.njit(cache=True, nogil=True, error_model="numpy")
def scalar_rows(codes, rule, normal, origin, extent, out):  # type: ignore[no-untyped-def]
    """(scalar - offset) * scale and three zeros, with `normal` (offset, scale), laid out as by classify_rows."""
    for z in range(extent[0]):
        for y in range(extent[1]):
            for x in range(extent[2]):
                s = scalar_of(codes[origin[0] + z, origin[1] + y, origin[2] + x], rule)
                for channel in range(4):
                    out[x & 1, z, y, channel, x >> 1] = (s - normal[0]) * normal[1] if channel == 0 else 0.0
