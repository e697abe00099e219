"""Prepare the layers of exact rays for the compiled kernels: the transfer function's intervals, and the light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.kernels import Intervals, LayerOptics, LightGrid, PlacedVoxels, RayShading
from renderer.scene import FACE_DEPTH, ClipSpec, ShadingSpec
from renderer.transfer import NO_LIGHT_GRID, TransferFunction
from renderer.volume import Float64, Volume

# The largest scalar or control value is scaled up to at least 2 to this power, so that differences and slopes do not
# vanish. Usual values need no scaling.
_LEAST_EXPONENT = -50
# The largest scalar or control value is scaled down to at most 2 to this power, so that sums do not overflow.
_LARGEST_EXPONENT = 1000
# The number of cells along each axis of a macrocell, as in `truth_cells.h` of the kernels.
_MACROCELL_SIZE = 4


class TrueLayer(NamedTuple):
    """A layer of a picture for exact rays: a volume, and how it is shown.

    Labels are not interpolated: at each point, the label rule chooses the label of one of the voxels around it. The
    gradient there is that of the smoothed opacities of voxels, which are 0 outside of the volume. A volume with a mask
    is shown at the points to which this rule gives the mask's label 1, and not beyond the mask's border.

    shading: colours are multiplied by ambient + diffuse * max(0, n . light), where n is the negative normalised world
        gradient (central differences at voxel centres, one-sided at the border, interpolated trilinearly); by ambient
        alone if the gradient is zero. Highlights and other effects are as in `ShadingSpec`.
    weight: a factor on extinction.
    clip: planes and boxes that clip this layer alone, in addition to those of the view.
    """

    volume: Volume
    transfer: TransferFunction
    shading: ShadingSpec | None = None
    light_grid: LightGrid = NO_LIGHT_GRID
    weight: float = 1.0
    clip: tuple[ClipSpec, ...] = ()


def optics_of(layer: TrueLayer) -> LayerOptics:
    """Return a layer as the record LayerOptics, which kernels take."""
    scale = largest_magnitude_scale(layer.volume, layer.transfer)
    intervals, spec = intervals_of(layer.transfer, scale), layer.shading
    return LayerOptics(
        voxels=voxels_of(layer.volume),
        macrocells=np.zeros(macrocell_counts(layer.volume), np.uint8),
        intervals=intervals,
        shading=None if spec is None else shading_of(spec, layer.light_grid, layer.volume, scale),
        weight=layer.weight,
        colors=layer.volume.colors,
        label_opacities=_label_opacities(intervals, layer.volume.finest_spacing) if layer.volume.is_labels else None,
    )


def _label_opacities(intervals: Intervals, finest_spacing: float) -> Float64:
    """Return the opacity of a voxel by the number of its label, from 0 to the first number above all control points."""
    numbers = np.arange(math.floor(intervals.knots[-1] / intervals.scale) + 2) * intervals.scale
    rows = intervals.rows[np.searchsorted(intervals.knots, numbers, side="right")]
    return np.asarray(-np.expm1(-(rows[:, 3] + rows[:, 7] * (numbers - rows[:, 8])) * finest_spacing))


def macrocell_counts(volume: Volume) -> list[int]:
    """Return the numbers of macrocells of a volume along z, y, x."""
    return [num // _MACROCELL_SIZE + 1 for num in volume.values.shape]


def voxels_of(volume: Volume) -> PlacedVoxels:
    """Return the voxels of a volume in a dtype that kernels read; float16, which they do not, becomes float32."""
    depth, height, width = volume.values.shape
    places = (np.arange(depth) * height * width, np.arange(height) * width, np.arange(width))
    voxels = volume.voxels or PlacedVoxels(volume.values.reshape(-1), *places)
    is_half = voxels.values.dtype == np.float16
    return voxels._replace(values=voxels.values.astype(np.float32)) if is_half else voxels


def largest_magnitude_scale(volume: Volume, transfer: TransferFunction) -> float:
    """Return the power of two by which scalars are multiplied, so that their sums and slopes are finite."""
    largest = max(_least_largest(volume), float(np.abs(transfer.values).max()))
    exponent = math.frexp(largest)[1]
    return math.ldexp(1.0, min(max(exponent, _LEAST_EXPONENT), _LARGEST_EXPONENT) - exponent)


def _least_largest(volume: Volume) -> float:
    """Return a number for the largest magnitude of the volume's values, which is used if control values are smaller.

    For float64 it is the largest magnitude itself, which takes a pass over all values. For other dtypes it is a lower
    bound, because float64 has room for their scaled values.
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
    slope[~np.isfinite(slope)] = 0.0  # an interval narrower than 1e-300 of the largest value is a step
    base = np.concatenate([points[:1], points])
    origin = np.concatenate([knots[:1], knots])
    num_opaque_below = np.concatenate([[0], np.cumsum(points[:, 3] > 0)])
    return Intervals(knots, np.column_stack([base, slope, origin, num_opaque_below]), scale)


def shading_of(spec: ShadingSpec, grid: LightGrid, volume: Volume, scale: float) -> RayShading:
    """Return the light on rays for scalars that are multiplied by `scale`."""
    index_from_world = np.linalg.inv(volume.world_from_index[:3, :3])
    is_camera = spec.light == "camera"
    # With light from the camera, the direction is not used: kernels take that of each ray.
    light = np.array((0.0, 0.0, 1.0) if is_camera else spec.light, np.float64)
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
        world_from_gradient=index_from_world.T,  # the transposed inverse of the matrix for points
        factors=_gradient_factors(spec.gradient_opacity or (), scale),
        grid=grid,
    )


def _gradient_factors(points: Sequence[tuple[float, float]], scale: float) -> Float64:
    """Return `RayShading.factors`. points: pairs of a gradient's magnitude and the factor on extinction there."""
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        magnitudes, factors = np.array(points, np.float64).reshape(-1, 2).T * [[scale], [1.0]]
        slopes = np.append(np.diff(factors) / np.diff(magnitudes), 0.0)[: len(points)]
    slopes[~np.isfinite(slopes)] = 0.0
    return np.ascontiguousarray(np.column_stack([magnitudes, factors, slopes]))
