"""Pyramid: per octree node the mean of its voxels and the error of replacing them by it.

Level l has cells of 2^l voxels a side; level 0 are the voxels themselves and is not stored, a table look-up gives it.
A node's four channels are those of `renderer.classify`: means of `(tau c, tau) h0` or of `(a c, a)`. Its error is the
root of the channels' summed variance (Laur and Hanrahan 1991, section 3: the RMS error of a node), of one of

    optical           (tau c, tau) h0     times the cell's side in the cut: what the node can put into a pixel
    rms, classified   (a c, a)            opacity over the finest spacing
    rms, scalar       s                   in data units

Only visible nodes are stored: every level is one list in Morton order, so that the children of a node lie together.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from queue import SimpleQueue
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer import pyramid_kernels as kernels
from renderer.classify import Classifier, make_classifier, voxel_codes
from renderer.pyramid_kernels import BRICK, BRICK_LEVELS
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import TransferFunction
from renderer.volume import Volume

# Means are stored as multiples of the largest possible one, brought to this: then float16 holds 8 decades below it at
# its full 11 bits (its normal numbers go down to 2^-14).
STORED_MAXIMUM = 2.0**15

# Bricks built by one task: large enough to hide the dispatch, small enough that its results stay in cache.
BRICKS_PER_TASK = 64


@dataclass(frozen=True)
class Level:
    """The visible nodes of one level, in Morton order of their cells.

    means: float16 or float32 [n, 4], stored units.
    errors: float16 or float32 [n], stored units.
    masks: uint8 [n], bit `x + 2 y + 4 z` set where that child is visible; empty on level 1.
    first_children: int64 [n], index in the level below of the first visible child; empty on level 1.
    """

    means: npt.NDArray[Any]
    errors: npt.NDArray[Any]
    masks: npt.NDArray[np.uint8]
    first_children: npt.NDArray[np.int64]


@dataclass(frozen=True)
class Pyramid:
    """levels[0] is level 1 and levels[-1] the root (no node, where nothing is visible). Multiply stored means by `mean_unit`
    and errors by `error_unit` to have them in the units above. `classifier` gives level 0 of the same quantity."""

    levels: tuple[Level, ...]
    mean_unit: float
    error_unit: float
    classifier: Classifier
    volume: Volume
    average: str
    measure: str

    @property
    def num_levels(self) -> int:
        """Number of the root's level."""
        return len(self.levels)

    @property
    def num_bytes(self) -> int:
        """Memory of all levels."""
        return sum(a.nbytes for level in self.levels for a in (level.means, level.errors, level.masks, level.first_children))


@dataclass(frozen=True)
class _Plan:
    """What the kernels are told: see pyramid_kernels.build_bricks. Scales bring compact results to stored units."""

    codes: npt.NDArray[Any]
    rule: Classifier
    error_rule: Classifier
    scalars: tuple[float, float]
    shared: bool
    mean_unit: float
    error_unit: float
    error_factor: float
    half: bool


def build_pyramid(
    volume: Volume,
    transfer: TransferFunction,
    *,
    spec: PyramidSpec,
    error: ErrorSpec,
    shading: ShadingSpec | None = None,
    num_threads: int = 2,
) -> Pyramid:
    """Build all levels in one pass over the voxels; the result does not depend on `num_threads`."""
    plan = _make_plan(volume, transfer, spec, error, shading)
    num_levels = max(1, (max(volume.shape_xyz) - 1).bit_length())
    bricks = _bricks_in_morton_order(volume.shape_xyz)
    tasks = [bricks[first : first + BRICKS_PER_TASK] for first in range(0, len(bricks), BRICKS_PER_TASK)]
    scratches: SimpleQueue[_Scratch] = SimpleQueue()
    for _ in range(num_threads):
        scratches.put(_Scratch.empty(plan, min(len(bricks), BRICKS_PER_TASK)))
    parts: list[list[_Part]] = [[] for _ in range(BRICK_LEVELS)]
    roots = []
    with ThreadPoolExecutor(num_threads) as pool:
        for task_parts, task_roots in pool.map(lambda task: _build_task(plan, task, scratches), tasks):
            for level, part in zip(parts, task_parts, strict=True):
                level.append(part)
            roots.append(task_roots)
    stored = [_join(level) for level in parts] + _upper_levels(plan, volume.shape_xyz, bricks, np.concatenate(roots), num_levels)
    return Pyramid(
        levels=_linked(stored[:num_levels]),
        mean_unit=plan.mean_unit,
        error_unit=plan.error_unit,
        classifier=plan.rule,
        volume=volume,
        average=spec.average,
        measure=error.measure,
    )


def _make_plan(
    volume: Volume, transfer: TransferFunction, spec: PyramidSpec, error: ErrorSpec, shading: ShadingSpec | None
) -> _Plan:
    opacity, of_opacity, of_scalar = spec.average == "opacity", error.measure == "rms", error.of == "scalar"
    depth = float(volume.spacing.min()) * transfer.max_extinction
    brightest = max(1.0, shading.ambient + shading.diffuse) if shading else 1.0

    def unit(of_opacity: bool) -> float:
        return _power_of_two(brightest * (-math.expm1(-depth) if of_opacity else depth)) / STORED_MAXIMUM

    scalars = (0.0, 0.0)
    error_unit, error_factor = unit(of_opacity), 1 / unit(of_opacity)
    if of_scalar:
        low, high = float(volume.values.min()), float(volume.values.max())
        error_unit, error_factor = _power_of_two(high / 2 - low / 2) * 2 / STORED_MAXIMUM, 1.0
        scalars = (low / 2 + high / 2, 1 / error_unit)
    return _Plan(
        voxel_codes(volume),
        make_classifier(volume, transfer, shading, opacity=opacity),
        make_classifier(volume, transfer, shading, opacity=of_opacity),
        scalars,
        opacity == of_opacity and not of_scalar,
        unit(opacity),
        error_unit,
        error_factor,
        spec.precision == "half",
    )


def _power_of_two(value: float) -> float:
    """The smallest power of two >= value; 1 for 0. Scaling by it rounds nothing."""
    return math.ldexp(1.0, math.frexp(value)[1]) if value > 0 else 1.0


def _bricks_in_morton_order(shape_xyz: tuple[int, int, int]) -> npt.NDArray[np.int64]:
    """int64 [n, 3]: brick coordinates (x, y, z), in bricks."""
    counts = [-(-n // BRICK) for n in shape_xyz]
    z, y, x = np.indices(counts[::-1]).reshape(3, -1)
    code = np.zeros(len(x), np.int64)
    for bit in range(max(counts).bit_length()):
        for axis, coordinate in enumerate((x, y, z)):
            code |= (coordinate >> bit & 1) << (3 * bit + axis)
    return np.stack([x, y, z], axis=1)[np.argsort(code, kind="stable")]


@dataclass(frozen=True)
class _Scratch:
    """Memory of one running task, used again by the next; see pyramid_kernels.build_bricks for the shapes."""

    build: tuple[Any, Any, Any]
    error_build: tuple[Any, Any, Any]
    counts: npt.NDArray[np.int64]
    means: tuple[npt.NDArray[np.float32], ...]
    variances: tuple[npt.NDArray[np.float32], ...]
    masks: tuple[npt.NDArray[np.uint8], ...]

    @classmethod
    def empty(cls, plan: _Plan, num_bricks: int) -> _Scratch:
        sizes = [BRICK >> level for level in range(1, BRICK_LEVELS + 1)]

        def build(dtype: type, sides: list[int], brick: int) -> tuple[Any, Any, Any]:
            return (
                np.empty((2, 2, brick, 4, brick // 2), dtype),
                tuple(np.empty((n, n, 4, n), dtype) for n in sides),
                tuple(np.empty((n, n, n), dtype) for n in sides),
            )

        return cls(
            build(np.float32, sizes, BRICK),
            # Errors of another quantity may be of scalars with a large offset: float64. The kernel's signature needs
            # arrays of that type even where they are not used.
            build(np.float64, [1] * BRICK_LEVELS, 1) if plan.shared else build(np.float64, sizes, BRICK),
            np.zeros(BRICK_LEVELS, np.int64),
            tuple(np.empty((num_bricks * n**3, 4), np.float32) for n in sizes),
            tuple(np.empty(num_bricks * n**3, np.float32) for n in sizes),
            tuple(np.empty(num_bricks * n**3, np.uint8) for n in sizes),
        )


# Stored means, stored errors and child masks of some nodes of one level.
_Part = tuple[npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[np.uint8]]


def _build_task(
    plan: _Plan, bricks: npt.NDArray[np.int64], scratches: SimpleQueue[_Scratch]
) -> tuple[list[_Part], npt.NDArray[np.float64]]:
    """The levels 1 to BRICK_LEVELS of some bricks, and of each brick what the levels above need (roots_out)."""
    scratch = scratches.get()
    try:
        roots = np.empty((len(bricks), 9))
        kernels.build_bricks(
            plan.codes, plan.rule, plan.error_rule, plan.scalars, plan.shared, bricks[:, ::-1] * BRICK, scratch.build,
            scratch.error_build, scratch.counts, scratch.means, scratch.variances, scratch.masks, roots,
        )  # fmt: skip
        parts = []
        for level, num in enumerate(scratch.counts):
            means = _stored(scratch.means[level][:num], 1 / plan.mean_unit, plan.half)
            errors = _stored(np.sqrt(scratch.variances[level][:num]), plan.error_factor, plan.half)
            parts.append((means, errors, scratch.masks[level][: num if level > 0 else 0].copy()))
        return parts, roots
    finally:
        scratches.put(scratch)


def _stored(values: npt.NDArray[np.float32], factor: float, half: bool) -> npt.NDArray[Any]:
    """A copy of `values` times `factor` (a power of two) in the stored precision."""
    scaled = values * np.float32(factor)
    if not half:
        return scaled
    out = np.empty(scaled.shape, np.uint16)
    kernels.halves(scaled.reshape(-1), scaled.reshape(-1).view(np.uint32), out.reshape(-1))
    return out.view(np.float16)


def _join(parts: list[_Part]) -> _Part:
    """One array of each kind; parts are let go as they are copied, so that hardly more than one copy is held."""
    lengths = [len(part[0]) for part in parts]
    joined = tuple(np.empty((sum(len(p[k]) for p in parts), *parts[0][k].shape[1:]), parts[0][k].dtype) for k in range(3))
    ends = np.cumsum(lengths)
    parts.reverse()
    for end in ends:
        part = parts.pop()
        for target, source in zip(joined, part, strict=True):
            if len(source):
                target[end - len(source) : end] = source
    return joined  # type: ignore[return-value]


def _upper_levels(
    plan: _Plan, shape_xyz: tuple[int, int, int], cells: npt.NDArray[np.int64], roots: npt.NDArray[np.float64], num_levels: int
) -> list[_Part]:
    """Levels above the bricks from the roots of all bricks, in float64; few nodes, plain numpy."""
    means, error_means, variances = roots[:, :4], roots[:, 4:8], roots[:, 8]
    levels = []
    for level in range(BRICK_LEVELS + 1, num_levels + 1):
        visible = means[:, 3] > 0
        num_voxels = np.prod(cell_extents(cells, level - 1, shape_xyz), axis=1).astype(np.float64)
        bits = (visible << (cells & 1) @ [1, 2, 4]).astype(np.uint8)
        parents = cells >> 1
        starts = np.flatnonzero(np.concatenate([[True], np.any(np.diff(parents, axis=0) != 0, axis=1)]))
        group = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(cells))))
        share = num_voxels / np.add.reduceat(num_voxels, starts)[group]
        means = np.add.reduceat(share[:, None] * means, starts)
        merged = np.add.reduceat(share[:, None] * error_means, starts)
        spread = np.sum((error_means - merged[group]) ** 2, axis=1)
        variances = np.add.reduceat(share * (variances + spread), starts)
        error_means, cells = merged, parents[starts]
        kept = means[:, 3] > 0
        levels.append(
            (
                _stored(means[kept].astype(np.float32), 1 / plan.mean_unit, plan.half),
                _stored(np.sqrt(variances[kept]).astype(np.float32), plan.error_factor, plan.half),
                np.bitwise_or.reduceat(bits, starts)[kept],
            )
        )
    return levels


def cell_extents(
    cells: npt.NDArray[Any], level: int, shape_xyz: tuple[int, int, int]
) -> npt.NDArray[np.int64]:
    """int64 [n, 3]: voxels along x, y, z in cells (x, y, z in units of 2^level voxels) that the border may cut."""
    first = cells.astype(np.int64) << level
    return np.minimum(np.array(shape_xyz) - first, 1 << level)


def _linked(stored: list[_Part]) -> tuple[Level, ...]:
    """Levels with the place of each node's first child: children are in the order of their parents."""
    levels = []
    for means, errors, masks in stored:
        num_children = np.bitwise_count(masks).astype(np.int64)
        first_children = np.cumsum(num_children) - num_children
        for array in (means, errors, masks, first_children):
            array.flags.writeable = False
        levels.append(Level(means, errors, masks, first_children))
    return tuple(levels)
