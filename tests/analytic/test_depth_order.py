"""Orders of compositing, against brute force along rays and numpy's stable sort."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from brickwork import AFFINES

from renderer.pyramid import Cut
from renderer.view import View, box_order, order_by_depth
from renderer.volume import Float64, Volume, make_volume

each_affine = pytest.mark.parametrize("affine", AFFINES.values(), ids=AFFINES.keys())


def random_cut(rng: np.random.Generator, shape_xyz: tuple[int, int, int], affine: Float64) -> Cut:
    """Leaves of mixed levels that cover most of a volume; chance decides which nodes are split or left out."""
    world_from_index = np.eye(4)
    world_from_index[:3, :3] = affine
    world_from_index[:3, 3] = [3, -2, 7]
    volume = make_volume(np.zeros(shape_xyz[::-1], np.uint8), world_from_index, "cells")
    levels, cells = [np.zeros(0, np.uint8)], [np.zeros((0, 3), np.int64)]
    nodes = np.zeros((1, 3), np.int64)
    for level in range((max(shape_xyz) - 1).bit_length(), -1, -1):
        nodes = nodes[np.all(nodes << level < shape_xyz, axis=1)]
        nodes = nodes[rng.random(len(nodes)) >= (0.1 if level < 3 else 0)]
        is_leaf = rng.random(len(nodes)) < (1 if level == 0 else 0.25 if level < 4 else 0)
        cells.append(nodes[is_leaf])
        levels.append(np.full(len(cells[-1]), level, np.uint8))
        nodes = (2 * nodes[~is_leaf][:, None] + (np.arange(8)[:, None] >> np.arange(3) & 1)).reshape(-1, 3)
    num = sum(map(len, levels))
    return Cut(np.concatenate(levels), np.concatenate(cells).astype(np.int32), np.ones((num, 4), np.float32), volume)


def looking(forward: Float64, eye: Float64, projection: str) -> View:
    """A view from `eye` along `forward`, both in the world."""
    z = -forward / np.linalg.norm(forward)
    x = np.cross(np.eye(3)[np.argmin(np.abs(z))], z)
    x /= np.linalg.norm(x)
    axes = np.array([x, np.cross(z, x), z])
    return View(axes, eye, 0.0, projection, 100.0, (64, 64))  # type: ignore[arg-type]  # one of the two literals


def to_index(volume: Volume, world: Float64) -> Float64:
    return np.asarray(np.linalg.solve(volume.world_from_index[:3, :3], world - volume.world_from_index[:3, 3]))


def to_world(volume: Volume, index: Float64) -> Float64:
    return np.asarray(volume.world_from_index[:3, :3] @ index + volume.world_from_index[:3, 3])


def hits(cut: Cut, origin: Float64, direction: Float64) -> Float64:
    """[k, 2]: the cells whose inside the ray crosses in front of its origin, and where along the ray; near first."""
    low = (cut.cells.astype(np.int64) << cut.levels[:, None].astype(np.int64)) - 0.5
    high = np.minimum(low + (1 << cut.levels[:, None].astype(np.int64)), np.array(cut.volume.shape_xyz) - 0.5)
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (low - origin) / direction, (high - origin) / direction
    inside = (origin > low) & (origin < high)
    a, b = np.where(direction == 0, np.where(inside, -np.inf, np.inf), a), np.where(direction == 0, np.inf, b)
    start = np.maximum(np.minimum(a, b).max(axis=1), 0)
    end = np.maximum(a, b).min(axis=1)
    crossed = np.flatnonzero(end - start > 1e-9)
    return np.column_stack([crossed, start[crossed]])[np.argsort(start[crossed], kind="stable")]


def assert_back_to_front(cut: Cut, view: View, origins: Float64, directions: Float64) -> int:
    """Along every ray (index space) a nearer cell comes later in the order; how many pairs of cells were compared."""
    order = box_order(cut.levels, cut.cells, cut.volume, view)
    np.testing.assert_array_equal(np.sort(order), np.arange(len(cut)))
    place = np.empty(len(cut), np.int64)
    place[order] = np.arange(len(cut))
    num_pairs = 0
    for origin, direction in zip(origins, directions, strict=True):
        crossed = hits(cut, origin, direction)[:, 0].astype(int)
        assert np.all(np.diff(place[crossed]) < 0)
        num_pairs += max(len(crossed) - 1, 0)
    return num_pairs


SHAPES = [(16, 16, 16), (13, 7, 21), (1, 32, 32)]
EYES = ["outside", "inside", "plane", "face", "corner"]


def perspective_eye(rng: np.random.Generator, where: str, shape: Float64) -> Float64:
    """In index space."""
    anywhere = rng.uniform(-0.5, shape - 0.5)
    if where == "outside":
        direction = rng.normal(size=3)
        return np.asarray((shape - 1) / 2 + direction / np.linalg.norm(direction) * shape.max() * rng.uniform(1, 3))
    if where == "plane":  # the first splitting plane of one axis, others of another
        anywhere[rng.integers(3)] = 2.0 ** (int(shape.max() - 1).bit_length() - 1) - 0.5
        anywhere[rng.integers(3)] = rng.integers(0, 4) - 0.5
    if where == "face":
        axis = rng.integers(3)
        anywhere[axis] = rng.choice([-0.5, shape[axis] - 0.5])
    if where == "corner":
        return np.array([-0.5, shape[1] - 0.5, -0.5])
    return anywhere


@each_affine
@pytest.mark.parametrize("where", EYES)
def test_boxes_in_perspective(affine: Float64, where: str) -> None:
    rng = np.random.default_rng(EYES.index(where))
    num_pairs = 0
    for shape_xyz in SHAPES:
        cut = random_cut(rng, shape_xyz, affine)
        eye = perspective_eye(rng, where, np.array(shape_xyz, float))
        if where in ("plane", "face", "corner") and not np.array_equal(affine, np.eye(3)):
            # Exactly on a plane of index space only up to rounding: order that eye, wherever it is.
            eye = to_index(cut.volume, to_world(cut.volume, eye))
        view = looking(rng.normal(size=3), to_world(cut.volume, eye), "perspective")
        targets = rng.uniform(-0.5, np.array(shape_xyz) - 0.5, (25, 3))
        num_pairs += assert_back_to_front(cut, view, np.repeat(eye[None], 25, axis=0), targets - eye)
    assert num_pairs > 25


@each_affine
@pytest.mark.parametrize("direction", ["random", "x", "-y", "z", "diagonal"])
def test_boxes_in_parallel_projection(affine: Float64, direction: str) -> None:
    rng = np.random.default_rng(11)
    named = {"x": [1, 0, 0], "-y": [0, -1, 0], "z": [0, 0, 1], "diagonal": [1, 0, 1]}
    num_pairs = 0
    for shape_xyz in SHAPES:
        cut = random_cut(rng, shape_xyz, affine)
        # Along axes of the index space, where splitting planes are seen edge-on.
        forward = affine @ np.array(named[direction], float) if direction in named else rng.normal(size=3)
        view = looking(forward, to_world(cut.volume, rng.normal(0, 100, 3)), "orthographic")
        along = np.linalg.solve(affine, view.forward)
        along[np.abs(along) < 1e-9 * np.abs(along).max()] = 0
        targets = rng.uniform(-0.5, np.array(shape_xyz) - 0.5, (25, 3))
        num_pairs += assert_back_to_front(cut, view, targets - 1000 * along, np.repeat(along[None], 25, axis=0))
    assert num_pairs > 25


def test_cells_of_one_key_keep_their_order() -> None:
    """An eye in the middle plane of x and y, far along z: columns on both sides are equally near."""
    rng = np.random.default_rng(0)
    volume = make_volume(np.zeros((1, 2, 2), np.uint8), np.eye(4), "")
    cells = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], np.int32)
    cut = Cut(np.zeros(4, np.uint8), cells, np.ones((4, 4), np.float32), volume)
    view = looking(np.array([0, 0, 1.0]), np.array([0.5, 0.5, -10.0]), "perspective")
    np.testing.assert_array_equal(box_order(cut.levels, cells, volume, view), np.arange(4))
    alone = random_cut(rng, (1, 1, 1), np.eye(3))
    assert len(box_order(alone.levels, alone.cells, alone.volume, view)) == len(alone) <= 1


BIGGEST = np.finfo(np.float32).max


@pytest.mark.parametrize(
    "depths",
    [
        [],
        np.random.default_rng(1).normal(size=70000) * 10.0 ** np.random.default_rng(2).integers(-30, 30, 70000),
        np.random.default_rng(0).integers(-3, 4, 5000),  # equal ones keep their order
        [0.0, -0.0, 1.0, -0.0, 0.0, -1.0, 1e-45, -1e-45],  # zeros of both signs are equal
        [-BIGGEST, BIGGEST, 0, -1e-45, np.inf, -np.inf],
    ],
    ids=["none", "any", "equal", "zeros", "ends"],
)
def test_depths_of_any_sign_and_size(depths: npt.ArrayLike) -> None:
    depths = np.asarray(depths, np.float32)
    np.testing.assert_array_equal(order_by_depth(depths), np.argsort(-depths.astype(np.float64), kind="stable"))
    assert order_by_depth(depths).dtype == np.uint32
