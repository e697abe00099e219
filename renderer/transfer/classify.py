"""Classification of voxels, compiled: the transfer function, and shading, applied to one voxel.

A voxel's four channels are `(tau c, tau) * h0` with `tau` its extinction, `c` its colour and `h0` the finest spacing:
optical depths of one voxel, without a unit. Where a pyramid averages opacities they are `(a c, a)` with
`a = 1 - exp(-tau h0)`. Extinction-weighted colours are what may be averaged (Wittenbrink, Malzbender, Goss 1998).

Values of at most 16 bits are read as unsigned bit patterns and classified by a table over all of them. Wider ones are
evaluated, exactly, in float64. A voxel without data, NaN, has no channels, and no part in the gradient of another one.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.compiled import fma, jit
from renderer.scene import ShadingSpec
from renderer.transfer.light_field import NO_LIGHT_FIELD, LightField, light_shares
from renderer.transfer.piecewise import Channels, TransferTable, evaluate
from renderer.transfer.transfer_function import VISIBILITY_THRESHOLD, TransferFunction, visibility_breakpoints
from renderer.volume import Float32, Float64, Volume

RawVoxels = npt.NDArray[Any]


class VoxelLighting(NamedTuple):
    """A light on voxels.

    light: the unit vector towards the light in world axes, ambient, diffuse; as `lambert_factor` takes it.
    world_from_gradient: float64 [3, 3], takes a gradient along the index axes to the world.
    field: how much of the light reaches each voxel; NO_LIGHT_FIELD where all of it does.
    """

    light: tuple[float, float, float, float, float]
    world_from_gradient: Float64
    field: LightField


class Classifier(NamedTuple):
    """A set of tables with which compiled loops classify a voxel.

    table: float32 [num_patterns, 4], channels by bit pattern; None for wider values.
    scalars: float64 [num_patterns], the scalar of each bit pattern; None for wider values.
    curve: the transfer function, extinctions times the finest spacing; None where `table` is used.
    is_opacity: whether the channels are (a c, a).
    lighting: None without shading.
    breakpoints: visibility breakpoints (`renderer.transfer.transfer_function`).
    """

    table: Float32 | None
    scalars: Float64 | None
    curve: TransferTable | None
    is_opacity: bool
    lighting: VoxelLighting | None
    breakpoints: Float64


def raw_voxels(volume: Volume) -> RawVoxels:
    """Return the voxels as compiled loops read them: unsigned bit patterns if they have at most 16 bits. A view."""
    size = volume.values.dtype.itemsize
    return volume.values.view({1: np.uint8, 2: np.uint16}[size]) if size <= 2 else volume.values


def make_classifier(
    volume: Volume,
    transfer: TransferFunction,
    shading: ShadingSpec | None,
    *,
    opacity: bool,
    field: LightField = NO_LIGHT_FIELD,
) -> Classifier:
    """Prepare classification of this volume's voxels, in opacities or in optical depths. field: of the shading."""
    finest_spacing, dtype = volume.finest_spacing, volume.values.dtype
    breakpoints, lighting = visibility_breakpoints(transfer, finest_spacing), None
    if shading:
        x, y, z = toward_light(shading).tolist()
        to_world = np.ascontiguousarray(np.linalg.inv(volume.world_from_index[:3, :3]).T)
        lighting = VoxelLighting((x, y, z, float(shading.ambient), float(shading.diffuse)), to_world, field)
    if dtype.itemsize > 2:
        return Classifier(None, None, transfer.curve(finest_spacing), opacity, lighting, breakpoints)
    patterns = np.arange(1 << 8 * dtype.itemsize, dtype=f"u{dtype.itemsize}").view(dtype)
    scalars = patterns.astype(np.float64)
    scalars[~np.isfinite(scalars)] = np.nan
    colors, extinctions = transfer.classify(np.nan_to_num(scalars))
    depths = np.where(np.isnan(scalars), 0.0, extinctions * finest_spacing)
    weights = -np.expm1(-depths) if opacity else depths
    weights[weights < VISIBILITY_THRESHOLD] = 0.0
    table = np.column_stack([colors * weights[:, None], weights]).astype(np.float32)
    return Classifier(table, scalars, None, opacity, lighting, breakpoints)


@jit
def classify_voxel(
    raw: RawVoxels,
    table: Float32 | None,
    scalars: Float64 | None,
    curve: TransferTable | None,
    is_opacity: bool,
    lighting: VoxelLighting | None,
    z: int,
    y: int,
    x: int,
) -> Channels:
    """Return the four channels of one voxel, lit if the scene has shading.

    Loops unpack the Classifier once: unpacking it here would count references for every voxel. Besides, numba drops the
    branch of an argument that is None, not of an attribute.
    """
    if table is not None:
        pattern = raw[z, y, x]
        r, g, b, a = table[pattern, 0], table[pattern, 1], table[pattern, 2], table[pattern, 3]
    if curve is not None:
        r, g, b, a = classify_scalar(float(raw[z, y, x]), curve, is_opacity)
    if lighting is not None:
        light = _lighting_factor(raw, scalars, lighting, z, y, x) if a > 0 else 1.0
        r, g, b = r * light, g * light, b * light
    return r, g, b, a


@jit
def classify_scalar(scalar: float, curve: TransferTable, is_opacity: bool) -> Channels:
    """Return the four channels of a scalar, unlit; 0 for NaN."""
    if math.isnan(scalar):
        return 0.0, 0.0, 0.0, 0.0
    r, g, b, weight = evaluate(curve, scalar)
    if is_opacity:
        weight = -np.expm1(-weight)
    weight = weight if weight >= VISIBILITY_THRESHOLD else 0.0
    return weight * r, weight * g, weight * b, weight


@jit
def scalar_at(raw: RawVoxels, by_pattern: Any, z: int, y: int, x: int) -> Any:
    """Return the scalar of a voxel, or another number that `by_pattern` gives for its bit pattern."""
    if by_pattern is None:
        return float(raw[z, y, x])
    return by_pattern[raw[z, y, x]]


@jit
def _one_sided(
    before: float, here: float, after: float, first: int, at: int, last: int
) -> tuple[float, float, int, int]:
    """Return the ends of a difference, values and places, with the voxel itself in place of neighbours without data."""
    if math.isnan(before):
        before, first = here, at
    if math.isnan(after):
        after, last = here, at
    return before, after, first, last


@jit
def _lighting_factor(raw: RawVoxels, scalars: Float64 | None, lighting: VoxelLighting, z: int, y: int, x: int) -> float:
    """Return the factor on the colour, by Lambert's law; ambient where the gradient is 0.

    Derivatives along the index axes are central, one-sided at the border and beside voxels without data, 0 across one
    voxel.
    """
    z0, y0, x0 = max(z - 1, 0), max(y - 1, 0), max(x - 1, 0)
    z1, y1, x1 = min(z + 1, raw.shape[0] - 1), min(y + 1, raw.shape[1] - 1), min(x + 1, raw.shape[2] - 1)
    x_low, x_high = scalar_at(raw, scalars, z, y, x0), scalar_at(raw, scalars, z, y, x1)
    y_low, y_high = scalar_at(raw, scalars, z, y0, x), scalar_at(raw, scalars, z, y1, x)
    z_low, z_high = scalar_at(raw, scalars, z0, y, x), scalar_at(raw, scalars, z1, y, x)
    here = scalar_at(raw, scalars, z, y, x)
    x_low, x_high, x0, x1 = _one_sided(x_low, here, x_high, x0, x, x1)
    y_low, y_high, y0, y1 = _one_sided(y_low, here, y_high, y0, y, y1)
    z_low, z_high, z0, z1 = _one_sided(z_low, here, z_high, z0, z, z1)
    # Only the direction counts. Differences of halves do not overflow. Where they are small, the full differences do
    # not overflow either, and halves would round denormals.
    gx, gy, gz = 0.5 * x_high - 0.5 * x_low, 0.5 * y_high - 0.5 * y_low, 0.5 * z_high - 0.5 * z_low
    if max(abs(gx), abs(gy), abs(gz)) < 1.0:
        gx, gy, gz = 2.0 * (x_high - x_low), 2.0 * (y_high - y_low), 2.0 * (z_high - z_low)
    gx, gy, gz = gx / max(x1 - x0, 1), gy / max(y1 - y0, 1), gz / max(z1 - z0, 1)
    light = lighting.light
    if lighting.field.occlusion.size + lighting.field.shadow.size > 0:
        ambient, diffuse = light_shares(lighting.field, z, y, x)
        light = (light[0], light[1], light[2], light[3] * ambient, light[4] * diffuse)
    largest = max(abs(gx), abs(gy), abs(gz))
    if largest == 0.0:
        return light[3]
    gx, gy, gz = gx / largest, gy / largest, gz / largest
    m = lighting.world_from_gradient
    factor: float = lambert_factor(
        m[0, 0] * gx + m[0, 1] * gy + m[0, 2] * gz,
        m[1, 0] * gx + m[1, 1] * gy + m[1, 2] * gz,
        m[2, 0] * gx + m[2, 1] * gy + m[2, 2] * gz,
        light,
    )
    return factor


def toward_light(shading: ShadingSpec) -> Float64:
    """Return the unit vector towards the light, in world axes, float64 [3]."""
    light = np.array(shading.light, np.float64)
    return np.asarray(light / np.linalg.norm(light))


@jit
def lambert_factor(x: Any, y: Any, z: Any, light: tuple[Any, ...]) -> Any:
    """Return `ambient + diffuse max(0, n . l)`, with the normal n against the world gradient (x, y, z).

    The gradient's largest component is about 1, so that squares neither overflow nor vanish. In the precision of the
    arguments, float32 or float64. light: the vector l towards the light, ambient, diffuse.
    """
    across = fma(x, light[0], fma(y, light[1], z * light[2]))
    length = np.sqrt(fma(x, x, fma(y, y, z * z)))
    return fma(light[4], max(np.float32(0.0), -across / length), light[3])
