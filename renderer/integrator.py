"""The ground truth: the emission-absorption integral of the continuous field, in float64 on the CPU.

The scalar is interpolated trilinearly between voxel centres, then classified; in the outer half voxel it takes the
nearest value, outside [-1/2, n - 1/2] there is nothing. One ray passes through each pixel's centre (N. Max, "Optical
Models for Direct Volume Rendering", IEEE TVCG 1995):

    C = int c(s) tau(s) exp(-int_0^s tau) ds,    alpha = 1 - exp(-int tau)

with s in world units. `renderer.integrator_kernel` tells how a ray is integrated: everything that is not smooth (cell
faces, control values of the transfer function, grazing light) is met exactly, and between, the error falls with the
eighth power of the step. Verified in the manner of T. Etiene et al., "Verifying Volume Rendering Using Discretization
Error Analysis", IEEE TVCG 2014: against closed forms, against an independent Riemann sum and by the order of
convergence.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from renderer.camera import View
from renderer.errors import RenderError
from renderer.integrator_kernel import BRICK, HEADROOM, Intervals, Lighting, integrate_rays
from renderer.scene import ShadingSpec
from renderer.volume import Float64, Volume

Int64 = npt.NDArray[np.int64]

# Rays of one task: small enough to keep every core busy until the end and to stop soon after an interrupt.
_RAYS_PER_TASK = 2048
_FIRST_STEP_VOXELS = 1.0
_MAX_REFINEMENTS = 12


class PiecewiseLinear(Protocol):
    """What the integral needs of a transfer function: it is linear between the control values, constant outside.

    values: float64 [n], not descending; of two equal ones the second rules at and above the value.
    colors: float64 [n, 3]. extinctions: float64 [n], per world unit, finite, >= 0.
    """

    @property
    def values(self) -> Float64: ...
    @property
    def colors(self) -> Float64: ...
    @property
    def extinctions(self) -> Float64: ...


@dataclass(frozen=True)
class Convergence:
    """How an image settled, per halving of the step.

    step_voxels: each step, compared with the one twice as long. change: the largest change of a channel of any pixel.
    num_pixels: the pixels integrated at this step; those that had settled before are left as they were.
    """

    step_voxels: tuple[float, ...]
    change: tuple[float, ...]
    num_pixels: tuple[int, ...]


def integrate(
    volume: Volume,
    transfer: PiecewiseLinear,
    view: View,
    *,
    step_voxels: float,
    shading: ShadingSpec | None = None,
) -> Float64:
    """The image as float64 [height, width, 4], premultiplied RGBA, unclipped, row 0 at the top.

    step_voxels: the longest quadrature step, in voxels of the index axes. Cells, control values and optical depths of
        1 end a step earlier. Without shading 1 is already accurate to about 1e-7 (CT scans of an engine and a tree).
    shading: colour times ambient + diffuse * max(0, n . light), n the negative normalised world gradient (central
        differences at voxel centres, one-sided at the border, interpolated trilinearly), and times ambient where the
        gradient is zero.
    """
    width, height = view.size
    pixels = np.arange(width * height)
    return _integrate_pixels(volume, transfer, view, pixels, step_voxels, shading).reshape(height, width, 4)


def converged_image(
    volume: Volume,
    transfer: PiecewiseLinear,
    view: View,
    *,
    tolerance: float,
    shading: ShadingSpec | None = None,
) -> tuple[Float64, Convergence]:
    """`integrate` at ever shorter steps, each pixel until two halvings in a row changed no channel by `tolerance`.

    Two, because one can agree by accident: with shading that was seen to leave thirty times the tolerance.
    Returns the image and the record of its convergence. Raises RenderError when a pixel does not settle.
    """
    width, height = view.size
    pixels = np.arange(width * height)
    step = _FIRST_STEP_VOXELS
    image = _integrate_pixels(volume, transfer, view, pixels, step, shading)
    steps: list[float] = []
    changes: list[float] = []
    was_calm = np.zeros(pixels.size, bool)
    counts: list[int] = []
    for _ in range(_MAX_REFINEMENTS):
        step /= 2
        finer = _integrate_pixels(volume, transfer, view, pixels, step, shading)
        change = np.abs(finer - image[pixels]).max(axis=1)
        image[pixels] = finer
        steps.append(step)
        changes.append(float(change.max()))
        counts.append(pixels.size)
        calm = change < tolerance
        unsettled = ~(calm & was_calm)
        pixels, was_calm = pixels[unsettled], calm[unsettled]
        if pixels.size == 0:
            return image.reshape(height, width, 4), Convergence(tuple(steps), tuple(changes), tuple(counts))
    raise RenderError(
        "the ray integral does not converge",
        where=volume.name,
        got=f"a change of {changes[-1]:.3g} at a step of {step:.3g} voxels, in {pixels.size} of {len(image)} pixels",
        expected=f"a change below {tolerance:g}",
        hint="ask for a larger tolerance",
    )


def world_rays(view: View, pixels: Int64) -> tuple[Float64, Float64, Float64]:
    """Rays through the centres of pixels, given by their numbers row by row from the top left corner.

    Returns origins and unit directions, float64 [n, 3], in world coordinates, and float64 [n]: the world length along
    each ray to the plane at depth `view.near`.
    """
    width, height = view.size
    row, column = np.divmod(pixels, width)
    x = (column + 0.5 - width / 2) / view.scale_px
    y = (height / 2 - row - 0.5) / view.scale_px
    world_from_view = view.view_from_world[:3, :3].T
    if view.projection == "orthographic":
        origins = view.eye + np.stack([x, y, np.zeros_like(x)], axis=1) @ world_from_view.T
        return origins, np.broadcast_to(view.forward, origins.shape), np.full(x.shape, view.near)
    direction = np.stack([x, y, np.full_like(x, -1.0)], axis=1)
    length = np.linalg.norm(direction, axis=1)  # world length per unit of depth
    direction = direction / length[:, None] @ world_from_view.T
    return np.broadcast_to(view.eye, direction.shape), direction, view.near * length


def _integrate_pixels(
    volume: Volume,
    transfer: PiecewiseLinear,
    view: View,
    pixels: Int64,
    step_voxels: float,
    shading: ShadingSpec | None,
) -> Float64:
    """Float64 [n, 4] for the given pixels; the result does not depend on the number of threads."""
    values = volume.values
    if values.dtype == np.float16:  # numba has none
        values = values.astype(np.float64)
        values.flags.writeable = False  # as in every Volume; the kernels are compiled for that
    index_from_world = np.asarray(np.linalg.inv(volume.world_from_index), np.float64)
    intervals = _intervals(transfer)
    lighting = _lighting(shading, index_from_world)
    radiance = np.empty((pixels.size, 4))
    bricks = np.zeros([n // BRICK + 1 for n in values.shape], np.uint8)

    def integrate_part(first: int) -> None:
        part = slice(first, first + _RAYS_PER_TASK)
        origins, directions, starts = world_rays(view, pixels[part])
        integrate_rays(
            values,
            bricks,
            origins @ index_from_world[:3, :3].T + index_from_world[:3, 3],
            directions @ index_from_world[:3, :3].T,
            starts,
            step_voxels,
            intervals,
            lighting,
            radiance[part],
        )

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(integrate_part, range(0, pixels.size, _RAYS_PER_TASK)))
    return radiance


def _intervals(transfer: PiecewiseLinear) -> Intervals:
    knots = np.array(transfer.values, np.float64) * HEADROOM
    points = np.column_stack([transfer.colors, transfer.extinctions])
    rise, run = np.diff(points, axis=0), np.diff(knots)[:, None]
    slope = np.zeros((knots.size + 1, 4))
    # An interval without width is a step: no value falls into it, and its slope is never used.
    slope[1:-1] = np.divide(rise, run, out=np.zeros_like(rise), where=run > 0)
    base = np.concatenate([points[:1], points])
    origin = np.concatenate([knots[:1], knots])
    num_opaque_below = np.concatenate([[0], np.cumsum(points[:, 3] > 0)])
    return Intervals(knots, np.column_stack([base, slope, origin, num_opaque_below]))


def _lighting(shading: ShadingSpec | None, index_from_world: Float64) -> Lighting:
    spec = shading or ShadingSpec()
    x, y, z = np.array(spec.light, np.float64) / np.linalg.norm(spec.light)
    # A gradient transforms with the transposed inverse of the map of points.
    first, second, third = ((float(a), float(b), float(c)) for a, b, c in index_from_world[:3, :3].T)
    return Lighting(
        shading is not None, float(spec.ambient), float(spec.diffuse), (float(x), float(y), float(z)), (first, second, third)
    )
