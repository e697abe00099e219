"""Prepare the optics of exact rays for the compiled kernels: the transfer function's intervals, and the light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.scene import ShadingSpec
from renderer.transfer import LightField, TransferFunction
from renderer.volume import Float64, Volume

# Scalars are scaled so that the largest scalar or control value lies between these powers of two, as it usually does:
# sums, differences and slopes then neither overflow nor vanish.
_LEAST_EXPONENT, _LARGEST_EXPONENT = -50, 1000
# Cells along each axis of a macrocell, as in `truth_cells.h` of the kernels.
_MACROCELL_SIZE = 4


class Intervals(NamedTuple):
    """A transfer function of n control values as n + 1 intervals, the first and last of them unbounded.

    knots: float64 [n], times `scale`, not descending. Interval k has knots[k - 1] <= value < knots[k]: the value of a
        step belongs to its upper side.
    rows: float64 [n + 1, 10], base [4], slope [4], origin and the number of the first k control points that have
        extinction: (r, g, b, extinction) of a value is base + slope * (value - origin).
    scale: of scalars and knots, a power of two with which sums and differences neither overflow nor vanish.
    """

    knots: Float64
    rows: Float64
    scale: float


class Gloss(NamedTuple):
    """A set of what a light has beyond Lambert's: highlights, factors on extinction by gradients, a light field.

    is_camera: the light comes from the viewer. is_two_sided, specular, shininess: as in ShadingSpec.
    world_from_index: float64 [3, 3]. field: how much of the light arrives.
    factors: float64 [n, 3], a magnitude, times `Intervals.scale`, the factor there and its slope up to the next one.
    """

    is_camera: bool
    is_two_sided: bool
    specular: float
    shininess: float
    world_from_index: Float64
    factors: Float64
    field: LightField


class LambertShading(NamedTuple):
    """A light: Lambert shading by the world gradient.

    light: float64 [3], the unit vector to the light; not used where it is the camera's.
    world_from_index_gradient: float64 [3, 3]. gloss: None for Lambert's law alone.
    """

    ambient: float
    diffuse: float
    light: Float64
    world_from_index_gradient: Float64
    gloss: Gloss | None


def for_macrocells(shape: tuple[int, ...], unknown: Any) -> npt.NDArray[Any]:
    """Return what is known about each macrocell of a volume of this shape, which is nothing yet."""
    return np.full([num // _MACROCELL_SIZE + 1 for num in shape], unknown)


def largest_magnitude_scale(volume: Volume, transfer: TransferFunction) -> float:
    """Return a power of two that brings the largest scalar or control value to where sums and slopes are finite."""
    largest = max(_least_largest(volume), float(np.abs(transfer.values).max()))
    exponent = math.frexp(largest)[1]
    return math.ldexp(1.0, min(max(exponent, _LEAST_EXPONENT), _LARGEST_EXPONENT) - exponent)


def _least_largest(volume: Volume) -> float:
    """Return what the largest magnitude of the values may be taken for, where control values are no larger.

    Only for float64 it is the largest itself, which takes a pass over all values: float64 has room for scaled float32.
    """
    dtype = volume.values.dtype
    if dtype == np.float64:
        return max(map(abs, volume.value_range()))
    return 1.0 if dtype.kind in "iu" else float(np.finfo(np.float32).smallest_subnormal)


def intervals_of(transfer: TransferFunction, scale: float) -> Intervals:
    """Return the intervals of a transfer function for scalars that are multiplied by `scale`."""
    knots = np.array(transfer.values, np.float64) * scale
    points = np.column_stack([transfer.colors, transfer.extinctions])
    rise, run = np.diff(points, axis=0), np.diff(knots)[:, None]
    slope = np.zeros((knots.size + 1, 4))
    # An interval of width 0 is a step. No value falls into it, so that its slope is never used.
    with np.errstate(over="ignore"):
        slope[1:-1] = np.divide(rise, run, out=np.zeros_like(rise), where=run > 0)
    slope[~np.isfinite(slope)] = 0.0  # narrower than 1e-300 of the largest value: a step
    base = np.concatenate([points[:1], points])
    origin = np.concatenate([knots[:1], knots])
    num_opaque_below = np.concatenate([[0], np.cumsum(points[:, 3] > 0)])
    return Intervals(knots, np.column_stack([base, slope, origin, num_opaque_below]), scale)


def shading_of(spec: ShadingSpec, field: LightField, volume: Volume, scale: float) -> LambertShading:
    """Return the light for scalars that are multiplied by `scale`."""
    index_from_world = np.asarray(np.linalg.inv(volume.world_from_index[:3, :3]), np.float64)
    is_camera = spec.light == "camera"
    light = np.array((0.0, 0.0, 1.0) if is_camera else spec.light, np.float64)  # the camera's is that of each ray
    gloss = None
    if not spec.is_plain:
        factors = _gradient_factors(spec.gradient_opacity or (), scale)
        shine = float(spec.specular), float(spec.shininess)
        rows = np.asarray(np.linalg.inv(index_from_world))
        gloss = Gloss(is_camera, spec.two_sided, *shine, rows, factors, field)
    # A gradient transforms with the transposed inverse of the map of points.
    to_world = index_from_world.T
    return LambertShading(float(spec.ambient), float(spec.diffuse), light / np.linalg.norm(light), to_world, gloss)


def _gradient_factors(points: Sequence[tuple[float, float]], scale: float) -> Float64:
    """Return Gloss.factors."""
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        magnitudes, factors = np.array(points, np.float64).reshape(-1, 2).T * [[scale], [1.0]]
        slopes = np.append(np.diff(factors) / np.diff(magnitudes), 0.0)[: len(points)]
    slopes[~np.isfinite(slopes)] = 0.0
    return np.ascontiguousarray(np.column_stack([magnitudes, factors, slopes]))
