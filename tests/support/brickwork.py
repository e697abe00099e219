"""Volumes for tests of bricks, and cuts and batches of bricks that are made by hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from splatting import look

from renderer.bricks import (
    BRICK_LEVELS,
    BRICK_SIZE,
    NO_LIGHT,
    PADDED_BRICK_SIZE,
    BrickBatch,
    BrickCut,
    BrickLayer,
    BrickLayers,
    Bricks,
    ScreenSampling,
    fill_scalar_texels,
    make_bricks,
    texel_rules,
)
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import TransferFunction
from renderer.view import View, box_order
from renderer.volume import Float32, Float64, Int32, UInt8, UInt32, Volume, make_volume

EXACTLY = ScreenSampling((1,), 0.0, 0.0)

LIT = ShadingSpec(0.3, 0.7, (1.0, -0.5, 2.0))
# A shading that depends on the view: a light at the camera, highlights, and factors on extinction by gradients, chosen
# for the gradients of `hills`.
GLOSSY = ShadingSpec(0.2, 0.6, "camera", 0.4, 20.0, True, ((0.01, 0.1), (0.2, 1.0), (0.4, 0.5)))
EACH_SHADING = pytest.mark.parametrize("shading", [None, LIT], ids=["plain", "lit"])

AFFINES = {
    "straight": np.eye(3),
    "anisotropic": np.diag([0.4, 1.0, 2.5]),
    "oblique": np.array([[0.8, -0.6, 0.0], [0.48, 0.64, -0.6], [0.36, 0.48, 0.8]]) @ np.diag([1.0, 0.7, 1.6]),
    "sheared": np.array([[1.0, 0.6, -0.3], [0.0, 0.9, 0.5], [0.0, 0.0, 1.2]]),
    "left-handed": np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.2], [0.0, 0.0, 1.0]]),
}

# Affines, each with a shading or without. Shading transforms gradients by the affine, so that it is tested with all
# affines. Without shading, two affines are enough.
SHADED_AFFINES = pytest.mark.parametrize(
    ("affine", "shading"),
    [*((affine, LIT) for affine in AFFINES), ("straight", None), ("sheared", None)],
    ids=[*(f"{affine}-lit" for affine in AFFINES), "straight-plain", "sheared-plain"],
)

CAMERAS = ("perspective", "orthographic", "inside", "near", "face")


def scalar_texels(bricks: Bricks, cells: Int32, *, lit: bool, toward_light: Float64 = NO_LIGHT) -> Float32:
    """Return the texels of bricks of level 0, float32 [n, 18, 18, 18], or with gradients if lit: [n, 4 * 18^3]."""
    texels = np.full((len(cells), (4 if lit else 1) * PADDED_BRICK_SIZE**3), np.nan, np.float32)
    rules = texel_rules(bricks, lit=lit, toward_light=toward_light)
    fill_scalar_texels(bricks, rules, cells, np.arange(len(cells)), texels)
    return texels if lit else texels.reshape(-1, *(PADDED_BRICK_SIZE,) * 3)


def placed(values: npt.ArrayLike, affine: Float64 | None = None) -> Volume:
    """Return a volume of voxels [z, y, x]. With an affine [3, 3], it lies away from the world's origin."""
    world_from_index = np.eye(4)
    if affine is not None:
        world_from_index[:3, :3] = affine
        world_from_index[:3, 3] = 30.0, -20.0, 10.0
    return make_volume(np.array(values, order="C"), world_from_index, "test")


def hills(shape: tuple[int, int, int], wave: float) -> Float32:
    """Return smooth waves in [0, 1], float32 [z, y, x]. wave: their wavelength in voxels."""
    z, y, x = np.ogrid[tuple(map(slice, shape))]
    k = 2 * np.pi / wave
    waves = np.sin(k * x + 0.3) * np.cos(k * y * 0.9) + np.sin(k * z * 1.1 + k * x / 2) * np.cos(k * y / 2)
    return np.asarray(0.5 + 0.25 * waves, np.float32)


def transfer_of(*points: tuple[float, tuple[float, float, float], float]) -> TransferFunction:
    """Return the transfer function with these control points: (value, colour, extinction) each."""
    values, colors, extinctions = zip(*points, strict=True)
    return TransferFunction(np.array(values, float), np.array(colors, float), np.array(extinctions, float), 1.0)


def bricks_of(
    volume: Volume,
    transfer: TransferFunction,
    shading: ShadingSpec | None = None,
    precision: str = "single",
    error: ErrorSpec | None = None,
) -> Bricks:
    """Return the bricks of a volume, of all levels."""
    spec = PyramidSpec(precision=precision)  # type: ignore[arg-type]
    baked = shading and shading.lambert
    return make_bricks(volume, transfer, spec=spec, error=error or ErrorSpec(), shading=baked, num_threads=1)


def random_cut(bricks: Bricks, seed: int, finest_level: int = 0) -> BrickCut:
    """Return a cut of bricks of mixed levels that cover all visible voxels. Chance decides which bricks are divided."""
    rng = np.random.default_rng(seed)
    nodes = np.zeros((1, 3), np.int32)
    levels, cells = [], []
    for level in range(len(bricks.levels) - 1, -1, -1):
        chance = 1.0 if level == finest_level else 0.4 if level < len(bricks.levels) - 1 else 0.0
        is_leaf = rng.random(len(nodes)) < chance
        levels.append(np.full(is_leaf.sum(), level, np.uint8))
        cells.append(nodes[is_leaf])
        nodes = (2 * nodes[~is_leaf][:, None] + (np.arange(8)[:, None] >> np.arange(3) & 1)).reshape(-1, 3)
        nodes = nodes[np.all(nodes * (BRICK_SIZE << level >> 1) < bricks.volume.shape_xyz, axis=1)].astype(np.int32)
    return cut_of_bricks(bricks, np.concatenate(levels), np.concatenate(cells))


def level_cut(bricks: Bricks, level: int) -> BrickCut:
    """Return the cut of all visible bricks of one level."""
    shape = bricks.levels[level].visible_bounds.shape[:3]
    cells = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)[:, ::-1]
    return cut_of_bricks(bricks, np.full(len(cells), level, np.uint8), cells.astype(np.int32))


def cut_of_bricks(bricks: Bricks, levels: UInt8, cells: Int32) -> BrickCut:
    """Return the cut of some bricks, without bricks that show nothing."""
    boxes, step_errors = np.empty((len(levels), 2, 3)), np.empty(len(levels))
    for i, (level, (x, y, z)) in enumerate(zip(levels, cells, strict=True)):
        of_level = bricks.levels[level]
        boxes[i] = 2.0**level * (BRICK_SIZE * cells[i] + of_level.visible_bounds[z, y, x].astype(np.float64)) - 0.5
        step_errors[i] = of_level.step_errors[z, y, x]
    is_seen = np.all(boxes[:, 0] < boxes[:, 1], axis=1)
    return BrickCut(levels[is_seen], cells[is_seen], boxes[is_seen], step_errors[is_seen], bricks.volume)


def alone(bricks: Bricks, shading: ShadingSpec | None = None) -> BrickLayers:
    """Return bricks as the only layer of a scene."""
    return BrickLayers((BrickLayer(bricks, shading),))


def batch_of(
    cut: BrickCut,
    bricks: Bricks,
    *,
    step: float | Sequence[float] = 1.0,
    shading: ShadingSpec | None = None,
    screen_sampling: ScreenSampling = EXACTLY,
) -> BrickBatch:
    """Return a batch of the bricks of a cut. step: the step of all bricks, or a step for each level, in cells."""
    volume = cut.volume
    steps = np.broadcast_to(np.asarray(step, np.float64), len(bricks.levels))[cut.levels]
    return BrickBatch(cut, alone(bricks, shading), steps, screen_sampling, volume.centre, volume.half_diagonal)


def view_of(
    volume: Volume, camera: str, size: tuple[int, int] = (20, 15), azimuth: float = 28.0, elevation: float = 15.0
) -> View:
    """Return a view of a volume.

    camera: one of CAMERAS: from outside (also `near`, whose near plane cuts the volume), from `inside` a brick, or from
    the faces between bricks (`face`).
    """
    diameter = float(np.linalg.norm(volume.world_from_index[:3, :3] @ np.array(volume.shape_xyz)))
    outside = look(
        "orthographic" if camera == "orthographic" else "perspective",
        size=size,
        target=tuple(volume.centre),
        distance=2 * diameter,
        azimuth=azimuth,
        elevation=elevation,
    )
    if camera in ("perspective", "orthographic"):
        return outside
    if camera == "near":
        return replace(outside, near=2 * diameter - 0.1 * min(volume.shape_xyz) * volume.finest_spacing)
    corner = volume.centre_index + 0.21 if camera == "inside" else np.minimum(BRICK_SIZE - 0.5, volume.centre_index)
    eye = volume.world_from_index[:3, :3] @ corner + volume.world_from_index[:3, 3]
    return replace(outside, target=eye, distance=0.0, scale_px=outside.scale_px / 3)


def ordered(cut: BrickCut, view: View) -> UInt32:
    """Return the numbers of all bricks of a cut, front to back."""
    return box_order(cut.levels + np.uint8(BRICK_LEVELS), cut.cells, cut.volume, view)[::-1].astype(np.uint32)
