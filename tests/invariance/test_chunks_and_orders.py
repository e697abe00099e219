"""Neither drawing in chunks nor mixing orders leaves anything out, and orders change without a jump."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from splatting import camera_pose, cut_of, in_order, look, place_splats, volume_of

from renderer.scene import SplatSpec, TurntablePath
from renderer.splats import make_splats
from renderer.view import make_order_blending, sort_directions, visible_order
from renderer.volume import Float64

# Steps (x, y, z) to the next cell along an axis or a diagonal of a plane.
NEIGHBOURS = np.array(
    [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 0), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1)]
)

# Orders of a smaller weight are left out.
MIN_WEIGHT = 2.0**-9

# Half of the angle, in radians, over which one order fades into another.
FADE_ANGLE = math.radians(1.1)

IDENTITY = np.eye(3)


def tilted(degrees: float) -> Float64:
    """Voxels a little out of the world's axes."""
    a = np.radians(degrees)
    turn = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    return np.asarray(turn @ np.array([[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]]))


@pytest.mark.parametrize("footprint", ["gaussian", "gouraud"])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_chunks_draw_what_one_go_draws(rasterizer, monkeypatch, footprint: str, projection: str) -> None:
    """Wherever the splats are: in the middle, beside and partly beside the picture, around the eye.

    300 layers at most; they differ by the rounding of float32, 6 u each.
    """
    rng = np.random.default_rng(4)
    for spread in (0.01, 0.1, 1.0, 4.5):
        for target in ((0.0, 0.0, 0.0), (0.9, 0.3, -0.4), (-9.0, 0.0, 2.0)):
            centers = rng.uniform(-spread, spread, (300, 3))
            sigma = spread * rng.uniform(0.02, 0.3)
            batch = place_splats(centers, sigma, 0.1, rng.uniform(0, 1, (300, 3)), SplatSpec(footprint))  # type: ignore[arg-type]
            seen = look(projection, target=target)
            for view in (seen, replace(seen, size=(1, 1))):
                whole = rasterizer.rasterize([batch], [in_order(batch)], view)
                with monkeypatch.context() as patch:
                    patch.setattr("renderer.draw.splats.splat_rasterizer.MIN_CHUNK_SPLATS", 16)
                    patch.setattr("renderer.draw.splats.splat_rasterizer.splats_per_chunk", lambda *_: 16)
                    chunked = rasterizer.rasterize([batch], [in_order(batch)], view)
                np.testing.assert_allclose(chunked, whole, atol=6 * 300 * 2.0**-24)


SHEARED = np.array([[1.0, 0.4, 0.0], [0.0, -0.9, 0.2], [0.0, 0.0, 3.0]])
STEP = 0.25


def turns(elevation: float, edges: Float64 = IDENTITY) -> list[list[tuple[float, Float64]]]:
    """The directions to sort along on a turntable of STEP degrees a frame."""
    path = TurntablePath(round(360 / STEP), elevation=elevation)
    turning = make_order_blending(edges, path)
    return [sort_directions(turning, -camera_pose(path, frame).direction) for frame in range(0, path.frames)]


@pytest.mark.parametrize("elevation", [0.0, -0.5, 20.0, 45.0, 80.0, 89.0])
@pytest.mark.parametrize("edges", [IDENTITY, SHEARED], ids=str)
def test_few_views_have_several_orders_and_shares_add_up(elevation: float, edges: Float64) -> None:
    mixtures = turns(elevation, edges)
    for mixture in mixtures:
        assert sum(weight for weight, _ in mixture) == pytest.approx(1, abs=1e-15)
        assert min(weight for weight, _ in mixture) > 0
    assert np.mean([len(mixture) > 1 for mixture in mixtures]) < 0.12


@pytest.mark.parametrize("elevation", [90.0, -90.0])
def test_seen_from_a_pole_no_neighbours_change_their_order(elevation: float) -> None:
    for mixture in turns(elevation):
        assert len(mixture) == 1


@pytest.mark.parametrize("elevation", [0.0, -0.5, 20.0, 89.0])
@pytest.mark.parametrize("edges", [IDENTITY, SHEARED, tilted(1e-8), tilted(0.004), tilted(0.1)], ids=str)
def test_the_share_in_which_a_neighbour_comes_first_changes_evenly(elevation: float, edges: Float64) -> None:
    """By no more in a frame than if it grew from 0 to 1 over twice the fade angle; and a third, for sampling."""
    steps = NEIGHBOURS @ edges.T
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    shares = np.array(
        [sum(weight * (steps @ direction > 0) for weight, direction in mixture) for mixture in turns(elevation, edges)]
    )
    changes = np.abs(np.diff(shares, axis=0))
    assert changes.max() < 1.35 * STEP / np.degrees(2 * FADE_ANGLE) + MIN_WEIGHT


def test_a_camera_that_stands_still_sorts_along_its_view() -> None:
    path = TurntablePath(1, start=30.0, elevation=20.0)
    turning = make_order_blending(IDENTITY, path)
    forward = -camera_pose(path, 0).direction
    ((weight, direction),) = sort_directions(turning, forward)
    np.testing.assert_array_equal(direction, forward)
    assert weight == 1.0


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("azimuth", [0.0, 0.3, 45.0, 60.0])
def test_unmixed_is_the_order_of_view_depths(projection: str, azimuth: float) -> None:
    """The only one, whatever the film; ties by the cell's place."""
    cut = cut_of(volume_of(np.random.default_rng(6).integers(0, 256, (7, 6, 5), np.uint8)), 0.3)
    splats = make_splats(cut, SplatSpec())
    view = look(projection, azimuth=azimuth, distance=40.0)
    order = visible_order(splats, view)
    depths = (splats.vertices[:, :3].astype(np.float64) @ view.forward).astype(np.float32)
    np.testing.assert_array_equal(np.sort(order), np.arange(len(cut)))
    rises = np.diff(depths[order].astype(np.float64))
    assert rises.max() <= 4 * 2.0**-24  # of the volume's radius: another sum of the same products
