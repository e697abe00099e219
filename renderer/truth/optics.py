"""Prepare the layers of exact rays for the compiled kernels: the transfer function's intervals, and the light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.kernels import Intervals, LayerOptics, LightGrid, RayShading
from renderer.scene import FACE_DEPTH, ClipSpec, ShadingSpec
from renderer.transfer import NO_LIGHT_GRID, TransferFunction
from renderer.volume import Float64, Volume

# Scalars are scaled so that the largest scalar or control value lies between these powers of two, as it usually does:
# sums, differences and slopes then neither overflow nor vanish.
_LEAST_EXPONENT, _LARGEST_EXPONENT = -50, 1000
# Cells along each axis of a macrocell, as in `truth_cells.h` of the kernels.
_MACROCELL_SIZE = 4


class TrueLayer(NamedTuple):
    """A volume in a picture, and how it is shown.

    shading: colour times ambient + diffuse * max(0, n . light), n the negative normalised world gradient (central
        differences at voxel centres, one-sided at the border, interpolated trilinearly), and times ambient where the
        gradient is zero; and what else `ShadingSpec` says.
    weight: a factor on extinction. clip: of this layer alone, besides those of the view.
    Between labels nothing is interpolated: at each point, one of those around it wins, and the gradient is that of the
    smoothed opacities of voxels, which are 0 around the volume. A volume with a mask is shown where 1 wins in that, and
    not beyond its border.
    """

    volume: Volume
    transfer: TransferFunction
    shading: ShadingSpec | None = None
    light_grid: LightGrid = NO_LIGHT_GRID
    weight: float = 1.0
    clip: tuple[ClipSpec, ...] = ()


def optics_of(layer: TrueLayer) -> LayerOptics:
    """Return a layer as the kernel takes it."""
    values = readable_values(layer.volume)
    scale = largest_magnitude_scale(layer.volume, layer.transfer)
    intervals, spec = intervals_of(layer.transfer, scale), layer.shading
    return LayerOptics(
        values=values,
        macrocells=for_macrocells(values.shape, np.uint8(0)),
        intervals=intervals,
        shading=None if spec is None else shading_of(spec, layer.light_grid, layer.volume, scale),
        weight=layer.weight,
        colors=layer.volume.colors,
        label_opacities=_label_opacities(intervals, layer.volume.finest_spacing) if layer.volume.is_labels else None,
    )


def _label_opacities(intervals: Intervals, finest_spacing: float) -> Float64:
    """Return the opacity of a voxel of each number up to the first one above all control points."""
    numbers = np.arange(math.floor(intervals.knots[-1] / intervals.scale) + 2) * intervals.scale
    rows = intervals.rows[np.searchsorted(intervals.knots, numbers, side="right")]
    return np.asarray(-np.expm1(-(rows[:, 3] + rows[:, 7] * (numbers - rows[:, 8])) * finest_spacing))


def for_macrocells(shape: tuple[int, ...], unknown: Any) -> npt.NDArray[Any]:
    """Return what is known about each macrocell of a volume of this shape, which is nothing yet."""
    return np.full([num // _MACROCELL_SIZE + 1 for num in shape], unknown)


def readable_values(volume: Volume) -> npt.NDArray[Any]:
    """Return the values of a volume in a dtype that kernels read: they lack float16, of which a copy is exact."""
    return volume.values.astype(np.float32) if volume.values.dtype == np.float16 else volume.values


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


def shading_of(spec: ShadingSpec, grid: LightGrid, volume: Volume, scale: float) -> RayShading:
    """Return the light on rays for scalars that are multiplied by `scale`."""
    index_from_world = np.linalg.inv(volume.world_from_index[:3, :3])
    is_camera = spec.light == "camera"
    light = np.array((0.0, 0.0, 1.0) if is_camera else spec.light, np.float64)  # the camera's is that of each ray
    return RayShading(
        is_plain=spec.is_plain,
        is_camera=is_camera,
        two_sided=spec.two_sided,
        ambient=spec.ambient,
        diffuse=spec.diffuse,
        specular=spec.specular,
        shininess=spec.shininess,
        silhouette=spec.silhouette,
        face_depth=FACE_DEPTH * volume.finest_spacing,
        light=light / np.linalg.norm(light),
        world_from_index=np.linalg.inv(index_from_world),
        world_from_gradient=index_from_world.T,  # the transposed inverse of the map of points
        factors=_gradient_factors(spec.gradient_opacity or (), scale),
        grid=grid,
    )


def _gradient_factors(points: Sequence[tuple[float, float]], scale: float) -> Float64:
    """Return `RayShading.factors` of pairs of a magnitude and a factor."""
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        magnitudes, factors = np.array(points, np.float64).reshape(-1, 2).T * [[scale], [1.0]]
        slopes = np.append(np.diff(factors) / np.diff(magnitudes), 0.0)[: len(points)]
    slopes[~np.isfinite(slopes)] = 0.0
    return np.ascontiguousarray(np.column_stack([magnitudes, factors, slopes]))
