"""Prepare the classification of voxels: the tables with which the kernels of `classify.h` colour and light a voxel.

A voxel's four channels are `(tau c, tau) * h0` with `tau` its extinction, `c` its colour and `h0` the finest spacing:
optical depths of one voxel, without a unit. If a pyramid averages opacities, the channels are `(a c, a)` with
`a = 1 - exp(-tau h0)`. Only colours that are weighted by extinction may be averaged (Wittenbrink, Malzbender, Goss
1998).

Values of at most 16 bits are read as unsigned bit patterns and classified by a table over all patterns. Wider values
are classified exactly, in float64. An absent voxel, NaN, has channels of 0, and no part in the gradients of its
neighbours.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.kernels import Classifier, LightGrid, VoxelLighting
from renderer.scene import ShadingSpec
from renderer.transfer.light_factors import NO_LIGHT_GRID
from renderer.transfer.transfer_function import VISIBILITY_THRESHOLD, TransferFunction, visibility_breakpoints
from renderer.volume import Float64, Volume

# Voxels as kernels read them: bit patterns in uint8 or uint16, or values of a wider type.
RawVoxels = npt.NDArray[Any]


def raw_voxels(volume: Volume) -> RawVoxels:
    """Return a view of a volume's voxels as kernels read them: unsigned bit patterns for voxels of at most 16 bits."""
    size = volume.values.dtype.itemsize
    return volume.values.view({1: np.uint8, 2: np.uint16}[size]) if size <= 2 else volume.values


def make_classifier(
    volume: Volume,
    transfer: TransferFunction,
    shading: ShadingSpec | None,
    *,
    opacity: bool,
    grid: LightGrid = NO_LIGHT_GRID,
) -> Classifier:
    """Return the classifier of a volume's voxels.

    shading: the light; None without light. opacity: whether the channels of voxels are opacities, not optical depths.
    grid: the light that reaches each voxel.
    """
    finest_spacing, dtype = volume.finest_spacing, volume.values.dtype
    breakpoints, lighting = visibility_breakpoints(transfer, finest_spacing), None
    if shading:
        light = np.array([*toward_light(shading), shading.ambient, shading.diffuse])
        to_world = np.ascontiguousarray(np.linalg.inv(volume.world_from_index[:3, :3]).T)
        lighting = VoxelLighting(light, to_world, grid)
    if dtype.itemsize > 2:
        curve = transfer.curve(finest_spacing)
        return Classifier(None, None, curve, opacity, lighting, breakpoints, volume.colors, volume.are_shown)
    patterns = np.arange(1 << 8 * dtype.itemsize, dtype=f"u{dtype.itemsize}").view(dtype)
    scalars = patterns.astype(np.float64)
    scalars[~np.isfinite(scalars)] = np.nan
    colors, extinctions = transfer.classify(np.nan_to_num(scalars))
    depths = np.where(np.isnan(scalars), 0.0, extinctions * finest_spacing)
    weights = -np.expm1(-depths) if opacity else depths
    weights[weights < VISIBILITY_THRESHOLD] = 0.0
    table = np.column_stack([colors * weights[:, None], weights]).astype(np.float32)
    return Classifier(table, scalars, None, opacity, lighting, breakpoints, volume.colors, volume.are_shown)


def toward_light(shading: ShadingSpec) -> Float64:
    """Return the unit vector towards the light, in world axes: float64 [3]."""
    light = np.array(shading.light, np.float64)
    return np.asarray(light / np.linalg.norm(light))
