"""The visibility order of bricks, against sorting along rays: bricks are boxes, which do not overlap."""

from __future__ import annotations

import numpy as np
import pytest
from brickwork import AFFINES, bricks_of, ordered, placed, random_cut, transfer_of

from renderer.bricks import BrickCut
from renderer.view import View
from renderer.volume import Float64

NUM_VIEWS = 12
RAYS_PER_VIEW = 40


def random_view(rng: np.random.Generator, cut: BrickCut) -> View:
    """From anywhere outside or inside, also from faces and corners of bricks, along any direction or an axis."""
    volume = cut.volume
    extent = np.array(volume.shape_xyz)
    eye = rng.uniform(-0.7, 1.7, 3) * extent
    if rng.random() < 0.4:
        eye = np.where(rng.random(3) < 0.5, np.round(eye / 16) * 16 - 0.5, eye)
    z = rng.standard_normal(3) if rng.random() < 0.7 else np.eye(3)[rng.integers(3)]
    axes = np.linalg.qr(np.column_stack([z, rng.standard_normal((3, 2))]))[0].T[[1, 2, 0]]
    axes[0] *= np.linalg.det(axes)
    world = volume.world_from_index[:3, :3] @ eye + volume.world_from_index[:3, 3]
    return View(axes, world, 0.0, rng.choice(["perspective", "orthographic"]), 30.0, (64, 64))


def crossed(cut: BrickCut, origin: Float64, direction: Float64) -> tuple[Float64, Float64]:
    """[n] each: where a ray in index coordinates enters the boxes of bricks and leaves them; none is met behind 0."""
    with np.errstate(divide="ignore"):
        a, b = ((cut.visible_bounds[:, k] - origin) / direction for k in (0, 1))
    return np.maximum(np.minimum(a, b).max(axis=1), 0.0), np.maximum(a, b).min(axis=1)


@pytest.mark.parametrize("affine", AFFINES)
def test_front_to_back_is_exact_along_every_ray(affine: str) -> None:
    rng = np.random.default_rng(len(affine))
    volume = placed(np.ones((52, 70, 85), np.uint8), AFFINES[affine])
    bricks = bricks_of(volume, transfer_of((0, (1, 1, 1), 1.0), (1, (1, 1, 1), 1.0)))
    index_from_world = np.linalg.inv(volume.world_from_index[:3, :3])
    num_behind_others = 0
    for seed in range(NUM_VIEWS):
        cut = random_cut(bricks, seed)
        view = random_view(rng, cut)
        place = np.empty(len(cut), int)
        place[ordered(cut, view)] = np.arange(len(cut))
        eye = index_from_world @ (view.target - volume.world_from_index[:3, 3])
        for _ in range(RAYS_PER_VIEW):
            inside = rng.uniform(0, 1, 3) * volume.shape_xyz - 0.5  # what the ray goes through
            if view.projection == "perspective":
                direction = inside - eye
                origin = eye
            else:  # the whole line: order does not end at the eye plane
                direction = index_from_world @ view.forward
                origin = inside - 1e3 * direction
            enter, leave = crossed(cut, origin, direction)
            met = np.flatnonzero(leave - enter > 1e-9 * np.abs(leave))
            along = met[np.argsort(enter[met])]
            assert np.all(np.diff(place[along]) > 0), (seed, view)
            num_behind_others += max(len(met) - 1, 0)
    assert num_behind_others > NUM_VIEWS * RAYS_PER_VIEW
