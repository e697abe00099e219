"""What a scene must look like, from the definitions alone: plain float64, without a pyramid, a merge or a shader.

Voxels are classified by interpolation, the mean and the variance of every octree cell are taken over its voxels in two
passes, and the cut is made from the top. It shares with the renderer the descriptions (Scene, Volume), the points of
the colormaps, and constants that define what is meant: the cap of an opacity of 1, and what counts as no opacity.

Two things are left to the renderer, because the definition leaves them open within rounding, and are verified to lie
there: whether a cell whose error is next to the tolerance is a leaf, and the order of cells at the same depth.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from renderer.scene import ColormapSpec, Scene, ShadingSpec, TransferSpec, colormap_points
from renderer.transfer import VISIBILITY_THRESHOLD
from renderer.transfer.transfer_function import MAX_VOXEL_DEPTH, NUM_COLORMAP_SAMPLES
from renderer.volume import Float64, Int64, Volume

Leaf = tuple[int, int, int, int]  # level, and x, y, z in units of the cell's own width

FLOAT32 = 2.0**-24
FLOAT16 = 2.0**-11

# What float16 holds of the largest channel: numbers are scaled to 2^15 there, and 2^-25 is half of the smallest one.
TINIEST_HALF = 2.0**-39

# Deviations whose squares leave float32: errors below this come out as anything from 0 to it.
SQUARE_IN_FLOAT32 = 2.0**-63


class DisagreementError(AssertionError):
    """The renderer has decided something that its definition does not allow."""


@dataclass(frozen=True)
class Cells:
    """The cells to draw, in the order of drawing, and what is not known about them.

    first, extent: int64 [n, 3], x, y, z of the first voxel and the number of voxels.
    depths: float64 [n], mean extinction times the finest spacing, with its bounds low, high [n].
    colors: float64 [n, 3], of the light that a cell gives off; color_slack [n]: how far off each may be.
    """

    first: Int64
    extent: Int64
    depths: Float64
    low: Float64
    high: Float64
    colors: Float64
    color_slack: Float64


@dataclass(frozen=True)
class Field:
    """Voxels [z, y, x] classified.

    depths: [..., 4], (tau c, tau) over the finest spacing. opacities: [..., 4], (a c, a). scalars: [...], and with
    `scale` a power of two, their largest is between 1/2 and 1.
    """

    depths: Float64
    opacities: Float64
    scalars: Float64
    scale: float
    volume: Volume
    deepest: float


def classify(volume: Volume, transfer: TransferSpec, shading: ShadingSpec | None) -> Field:
    """Every voxel's channels."""
    scalars = volume.values.astype(np.float64)
    spacing = float(np.linalg.norm(volume.world_from_index[:3, :3], axis=0).min())
    unit = spacing if transfer.unit is None else transfer.unit
    colors, extinctions, deepest = _interpolated(scalars, transfer, unit, spacing)
    depths = extinctions * spacing
    depths[depths < VISIBILITY_THRESHOLD] = 0.0
    opacities = -np.expm1(-depths)
    opacities[opacities < VISIBILITY_THRESHOLD] = 0.0
    if shading is not None:
        colors = colors * _light(volume, scalars, shading)[..., None]
    scale = _power_of_two(np.abs(scalars).max())
    return Field(
        np.concatenate([colors * depths[..., None], depths[..., None]], axis=-1),
        np.concatenate([colors * opacities[..., None], opacities[..., None]], axis=-1),
        scalars * scale,
        scale,
        volume,
        deepest * spacing,
    )


def _interpolated(
    scalars: Float64, transfer: TransferSpec, unit: float, spacing: float
) -> tuple[Float64, Float64, float]:
    """Colours, extinctions (1 / world unit), and the largest extinction that the function has anywhere."""
    mapping = transfer.mapping
    if isinstance(mapping, ColormapSpec):
        at, opacities = (np.array(column, np.float64) for column in zip(*mapping.opacity, strict=True))
        color_at, table = _colormap(mapping)
    else:
        at = color_at = np.array([point.value for point in mapping])
        opacities = np.array([point.opacity for point in mapping])
        table = np.array([point.color for point in mapping])
    most = MAX_VOXEL_DEPTH / spacing
    extinctions = np.array([most if a == 1 else min(-math.log1p(-a) / unit, most) for a in opacities])
    colors = np.stack([_between(scalars, color_at, table[:, k]) for k in range(3)], axis=-1)
    return colors, _between(scalars, at, extinctions), float(extinctions.max())


def _colormap(mapping: ColormapSpec) -> tuple[Float64, Float64]:
    """The numbers next to its samples, each of which has the colour of its own place in the range."""
    first, last = (Fraction(end) for end in mapping.range)
    table = np.array(colormap_points(mapping.name, NUM_COLORMAP_SAMPLES))
    at = sorted({float(first + (last - first) * k / (len(table) - 1)) for k in range(len(table))})
    places = [float((Fraction(value) - first) / (last - first) * (len(table) - 1)) for value in at]
    colors = [np.interp(places, np.arange(len(table)), channel) for channel in table.T]
    return np.array(at), np.stack(colors, axis=-1)


def _between(s: Float64, at: Float64, values: Float64) -> Float64:
    """Linear between the points, constant outside of them; of two points at one place the second belongs to it."""
    result = np.full(s.shape, values[0])
    scale = _power_of_two(max(np.abs(at).max(), 0.0))
    for k in range(len(at) - 1):
        if at[k] < at[k + 1]:
            inside = (at[k] <= s) & (s < at[k + 1])
            # Scaled, so that neither a width nor its inverse leaves float64.
            share = (s[inside] * scale - at[k] * scale) / (at[k + 1] * scale - at[k] * scale)
            result[inside] = (1 - share) * values[k] + share * values[k + 1]
    result[s >= at[-1]] = values[-1]
    return result


def _power_of_two(largest: float) -> float:
    """What brings `largest` near 1, as far as float64 has it; 1 for 0."""
    return math.ldexp(1.0, min(max(-math.frexp(largest)[1], -1020), 1020)) if largest > 0 else 1.0


def _light(volume: Volume, scalars: Float64, shading: ShadingSpec) -> Float64:
    """ambient + diffuse max(0, n . l) with n against the gradient, which is that of central differences."""
    # In fractions: beside the largest numbers the smallest still have a slope.
    exact = np.vectorize(Fraction, otypes=[object])(scalars)
    slopes = np.stack([_slope(exact, axis) for axis in (2, 1, 0)], axis=-1)
    largest = np.abs(slopes).max(axis=-1)
    flat = largest == 0
    gradient = (slopes / np.where(flat, 1, largest)[..., None]).astype(np.float64)
    edges = volume.world_from_index[:3, :3]
    world = gradient @ np.linalg.inv(edges / np.linalg.norm(edges, axis=0).min())
    world /= np.where(flat, 1, np.linalg.norm(world, axis=-1))[..., None]
    light = np.array(shading.light) / np.abs(shading.light).max()
    cosine = np.maximum(0, -world @ (light / np.linalg.norm(light)))
    return np.where(flat, shading.ambient, shading.ambient + shading.diffuse * cosine)


def _slope(values: npt.NDArray[np.object_], axis: int) -> npt.NDArray[np.object_]:
    """Central differences, one-sided at the border, 0 across one voxel."""
    at = np.arange(values.shape[axis])
    low, high = np.maximum(at - 1, 0), np.minimum(at + 1, len(at) - 1)
    steps = np.maximum(high - low, 1).astype(object).reshape([-1 if k == axis else 1 for k in range(3)])
    return np.asarray((values.take(high, axis) - values.take(low, axis)) / steps)


def require_cut(field: Field, scene: Scene, tolerance: float, finest_level: int, leaves: Collection[Leaf]) -> None:
    """Raise DisagreementError unless `leaves`, which are the renderer's, are the cut that the definition gives."""
    given = set(leaves)
    if len(given) != len(leaves):
        raise DisagreementError(f"{len(leaves) - len(given)} cells come twice")
    num_levels = max(1, (max(field.volume.shape_xyz) - 1).bit_length())
    expected: list[Leaf] = []
    todo = [(num_levels, 0, 0, 0)]
    while todo:
        cell = todo.pop()
        level, x, y, z = cell
        window = _window(cell)
        if not field.depths[window][..., 3].any():  # also where there is no voxel at all
            continue
        if level == 0 or level <= finest_level:
            expected.append(cell)
            continue
        error, slack = _node_error(field, scene, cell)
        is_leaf = error < tolerance
        if is_leaf != (cell in given) and abs(error - tolerance) <= slack:
            is_leaf = not is_leaf
        if is_leaf:
            expected.append(cell)
        else:
            todo += [
                (level - 1, 2 * x + (k & 1), 2 * y + (k >> 1 & 1), 2 * z + (k >> 2)) for k in range(8)
            ]  # fmt: skip
    if set(expected) != given:
        extra, missing = sorted(given - set(expected))[:3], sorted(set(expected) - given)[:3]
        errors = {cell: _node_error(field, scene, cell)[0] for cell in (*extra, *missing) if cell[0] > 0}
        raise DisagreementError(f"wrong cut at {tolerance!r}: extra {extra}, missing {missing}, errors {errors}")


def _window(cell: Leaf) -> tuple[slice, slice, slice]:
    level, *corner = cell
    x, y, z = (slice(c << level, (c + 1) << level) for c in corner)
    return z, y, x


def _node_error(field: Field, scene: Scene, cell: Leaf) -> tuple[float, float]:
    """The error of a cell of level 1 or more from all its voxels, and how far off rounding may put it."""
    window = _window(cell)
    half = FLOAT16 if scene.pyramid.precision == "half" else 0.0
    if scene.error.of == "scalar":
        voxels, whole = field.scalars[window].reshape(-1, 1), field.scalars
        rounding = 2.0**-51 * float(np.abs(whole).max())  # of what is subtracted to centre them
        unit = float(np.ptp(whole))
        scale = 1 / field.scale
    else:
        channels = field.opacities if scene.error.measure == "rms" else field.depths
        voxels, whole = channels[window].reshape(-1, 4), channels
        rounding = 4 * FLOAT32 * float(np.abs(voxels).max()) + SQUARE_IN_FLOAT32
        # The largest that the channels could have, and 2 for the brightest light.
        unit = 2 * float(-math.expm1(-field.deepest) if scene.error.measure == "rms" else field.deepest)
        scale = 1.0
    if scene.error.measure == "optical":
        edges = field.volume.world_from_index[:3, :3]
        spacing = float(np.linalg.norm(edges, axis=0).min())
        scale = float(np.cbrt(len(voxels) * abs(np.linalg.det(edges / spacing))))
    apart = voxels - voxels[0]
    deviation = float(np.sqrt(((apart - apart.mean(axis=0)) ** 2).mean(axis=0).sum()))
    if scene.pyramid.precision == "half":
        rounding += TINIEST_HALF * unit
    return deviation * scale, ((2 * half + 16 * FLOAT32) * deviation + rounding) * scale


def drawn(field: Field, scene: Scene, order: list[Leaf]) -> Cells:
    """The content of these cells."""
    shape = np.array(field.volume.shape_xyz)
    first = np.array([[c << cell[0] for c in cell[1:]] for cell in order], np.int64).reshape(-1, 3)
    sides = np.array([1 << cell[0] for cell in order], np.int64)
    extent = np.minimum(shape - first, sides[:, None])
    rows = np.array([_content(field, scene, cell) for cell in order]).reshape(-1, 7)
    return Cells(first, extent, rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3:6], rows[:, 6])


def _content(field: Field, scene: Scene, cell: Leaf) -> tuple[float, float, float, float, float, float, float]:
    """Depth with its bounds, colour, and the slack of the colour."""
    if cell[0] == 0:
        red, green, blue, depth = field.depths[_window(cell)][0, 0, 0]
        low, high, slack = depth * (1 - 4 * FLOAT32), depth * (1 + 4 * FLOAT32), 4 * FLOAT32
        return depth, low, high, red / depth, green / depth, blue / depth, 2 * slack
    averaged = field.opacities if scene.pyramid.average == "opacity" else field.depths
    mean = averaged[_window(cell)].reshape(-1, 4).mean(axis=0)
    noise, absolute = 8 * FLOAT32 * mean, 0.0
    low, stored, high = np.maximum(mean - noise, 0), mean, mean + noise
    if scene.pyramid.average == "opacity":
        low, stored, high = (_as_depths(channels, field.deepest) for channels in (low, stored, high))
    if scene.pyramid.precision == "half":
        absolute = 2 * field.deepest * TINIEST_HALF
        low, stored, high = _half(low), _half(stored), _half(high)
    low, high = np.maximum(low - absolute, 0), high + absolute
    shallow, depth, deep = (float(channels[3]) for channels in (low, stored, high))
    color = stored[:3] / stored[3]
    brightest, darkest = high[:3] / max(low[3], 1e-300), low[:3] / high[3]
    slack = min(2.0, float(np.maximum(brightest - color, color - darkest).max()) + 8 * FLOAT32)
    return depth, shallow, deep, *color.tolist(), slack


def _half(values: Float64) -> Float64:
    """Rounded to the 11 bits of float16, whatever the exponent."""
    mantissas, exponents = np.frexp(values)
    return np.asarray(np.ldexp(np.rint(mantissas * 2048) / 2048, exponents))


def _as_depths(channels: Float64, deepest: float) -> Float64:
    """(a c, a) as (tau c, tau)."""
    opacity = float(channels[3])
    depth = deepest if opacity >= 1 else min(-math.log1p(-opacity), deepest)
    return channels * (depth / opacity if opacity > 0 else 1.0)


def centers(field: Field, cells: Cells) -> Float64:
    """float64 [n, 3]: of the cells, in the world."""
    world_from_index = field.volume.world_from_index
    return np.asarray((cells.first + (cells.extent - 1) / 2) @ world_from_index[:3, :3].T + world_from_index[:3, 3])
