"""Means over pixels, and their variances, against areas that are known exactly: edges, wires, ramps, a sphere."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from brickwork import transfer_of
from ray_integrals import look, volume

from renderer.truth import (
    Convergence,
    MeanPicture,
    PixelMeans,
    RayIntegrator,
    TrueLayer,
    mean_over_pixels,
    means_over,
    pixel_centres,
    places_in_pixels,
)
from renderer.view import View
from renderer.volume import Bools, Float64, Volume, make_volume

SIZE = (24, 18)
WHITE, RED, BLUE = (1.0, 1.0, 1.0), (0.9, 0.2, 0.1), (0.1, 0.3, 0.8)
OPAQUE = 1e6  # optical depth in a unit of length
PROJECTIONS = pytest.mark.parametrize("projection", ["perspective", "orthographic"])


class Traced:
    """Rays of one layer, in place of those of a stage."""

    def __init__(self, layer: TrueLayer) -> None:
        self._integrator = RayIntegrator([layer])

    def integrate(self, view: View, places: Float64, step: float) -> Float64:
        return self._integrator.integrate(view, places, [step])[0]

    def converge(self, view: View, places: Float64, tolerance: float, tell: Any) -> tuple[Float64, Convergence]:
        return self._integrator.converge(view, places, tolerance, tell)


class Painted:
    """Rays that find opaque white where a shape is, and nothing beside it."""

    def __init__(self, is_inside: Callable[[Float64], Bools]) -> None:
        self._is_inside = is_inside

    def integrate(self, _view: View, places: Float64, _step: float) -> Float64:
        return np.repeat(self._is_inside(places)[:, None], 4, axis=1).astype(float)

    def converge(self, view: View, places: Float64, _tolerance: float, tell: Any) -> tuple[Float64, Convergence]:
        tell(1.0)
        return self.integrate(view, places, 1.0), Convergence((0.5,), (0.0,), (len(places),))


def picture_of(rays: Any, view: View, background: Any = BLUE, seed: int = 0) -> MeanPicture:
    return mean_over_pixels(rays, view, background, 1e-6, seed=(seed,))


def area_below(corners: Float64, normal: Float64, offset: float) -> Float64:
    """The polygon [n, 2] without what lies beyond normal . p = offset (Sutherland and Hodgman 1974)."""
    found, heights = [], (corners @ normal - offset).tolist()
    for (one, other), (low, high) in zip(
        pairwise([*corners, corners[0]]), pairwise([*heights, heights[0]]), strict=True
    ):
        if low <= 0:
            found.append(one)
        if (low <= 0) != (high <= 0):
            found.append(one + low / (low - high) * (other - one))
    return np.array(found).reshape(-1, 2)


def area(corners: Float64) -> float:
    x, y = corners.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)


def coverage(edges: list[tuple[Float64, float]]) -> Float64:
    """The share [h, w] of each pixel in the convex set normal . p <= offset of all edges."""
    shares = []
    for centre in pixel_centres(SIZE):
        polygon = centre + np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
        for normal, offset in edges:
            polygon = area_below(polygon, normal, offset) if len(polygon) else polygon
        shares.append(area(polygon) if len(polygon) else 0.0)
    return np.reshape(shares, SIZE[::-1])


def project(view: View, points: Float64) -> Float64:
    """World positions [n, 3] to places in the picture [n, 2]."""
    x, y, z = view.view_from_world(points).T
    scale = view.scale_px / (-z if view.projection == "perspective" else 1.0)
    return np.stack([view.size[0] / 2 + scale * x, view.size[1] / 2 - scale * y], axis=1)


def assert_means(rays: Any, view: View, background: Any, shares: Float64) -> None:
    """Colours are mixtures of red and the background, as far off as the variances tell; most pixels need few rays."""
    expected = shares[..., None] * RED + (1 - shares[..., None]) * background
    found = [picture_of(rays, view, background, seed) for seed in range(10)]
    errors = np.array([each.means.colors - expected for each in found])
    seen, told = float(np.mean(errors**2)), float(np.mean([each.means.variances for each in found]))
    assert seen == pytest.approx(told, rel=0.25)
    assert told < 1e-5 and np.abs(errors).max() < 0.12
    assert np.abs(errors.mean(axis=(0, 1, 2))).max() < 4 * math.sqrt(told / errors[..., 0].size)
    on_edges = (shares > 1e-2) & (shares < 1 - 1e-2)
    assert on_edges.sum() > 15
    assert min(each.num_rays[on_edges].min() for each in found) >= 32
    assert np.median(found[0].num_rays) == 2


@PROJECTIONS
@pytest.mark.parametrize("background", [BLUE, WHITE], ids=["blue", "white"])
def test_an_edge_between_labels(projection: str, background: Any) -> None:
    """An opaque half-space, which the camera sees from its edge: a slanted line across the pixels."""
    view = look((0.0, 0.0, 0.0), 30.0, SIZE, projection=projection, field_of_view=30.0)
    angle, spacing, num = math.radians(23.0), 0.5, 120
    right, up, back = view.axes
    axes = [math.cos(angle) * right + math.sin(angle) * up, math.cos(angle) * up - math.sin(angle) * right, back]
    affine = np.eye(4)
    affine[:3, :3] = spacing * np.transpose(axes)
    affine[:3, 3] = -affine[:3, :3] @ [(num - 1) / 2, (num - 1) / 2, 1.5]
    labels = np.zeros((4, num, num), np.uint8)
    labels[:, :, num // 2 :] = 1
    half = replace(make_volume(labels, affine, "half"), is_labels=True)
    steps = transfer_of((-0.5, RED, 0.0), (0.5, RED, 0.0), (0.5, RED, OPAQUE), (1.5, RED, OPAQUE))
    normal = np.array([-math.cos(angle), math.sin(angle)])  # rows of a picture go down
    shares = coverage([(normal, float(normal @ np.array(SIZE) / 2))])
    assert_means(Traced(TrueLayer(half, steps)), view, background, shares)


def even(value: float = 1.0) -> tuple[Volume, Any]:
    affine = np.eye(4)
    affine[:3, 3] = [-2.0, -1.5, -1.0]
    return volume(np.full((3, 4, 5), value), affine), transfer_of((0.0, RED, OPAQUE), (1.0, RED, OPAQUE))


@PROJECTIONS
def test_the_silhouette_of_a_box(projection: str) -> None:
    """The convex hull of its eight corners."""
    box, transfer = even()
    view = look((0.1, -0.2, 0.1), 16.0, SIZE, projection=projection, field_of_view=28.0)
    corners = np.array([[x, y, z] for x in (-2.5, 2.5) for y in (-2.0, 2.0) for z in (-1.5, 1.5)])
    places, edges = project(view, corners), []
    for one in places:
        for other in places:
            normal = np.array([other[1] - one[1], one[0] - other[0]])
            offset = float(normal @ one)
            if np.any(one != other) and np.all(places @ normal <= offset + 1e-9):
                edges.append((normal, offset))
    assert len(edges) == 6
    assert_means(Traced(TrueLayer(box, transfer)), view, BLUE, coverage(edges))


def test_a_ramp_has_the_colour_of_each_centre() -> None:
    """And the variance of a slope: that of a place in a square, by the number of squares and of rays in each."""
    view = look((0.0, 0.0, 0.0), 9.0, SIZE, projection="orthographic", field_of_view=90.0)
    values = np.tile(np.arange(64.0) / 64, (4, 64, 1))
    affine = np.eye(4)
    affine[:3, :3] = 0.5 * view.axes.T
    affine[:3, 3] = -affine[:3, :3] @ [31.5, 31.5, 1.5]
    transfer = transfer_of((0.0, (0, 0, 0), OPAQUE), (1.0, WHITE, OPAQUE))
    found = picture_of(Traced(TrueLayer(volume(values, affine), transfer)), view)
    place = (pixel_centres(SIZE)[:, 0] - SIZE[0] / 2) / view.scale_px / 0.5 + 31.5
    expected = (place / 64).reshape(SIZE[::-1])
    slope = 1 / view.scale_px / 0.5 / 64
    assert set(found.num_rays.ravel().tolist()) == {8, 32}
    variances = slope**2 / 12 / (found.num_rays / 2) / found.num_rays
    errors = found.means.colors[..., 0] - expected
    assert np.mean(errors**2 / variances) == pytest.approx(1.0, abs=0.25)
    assert np.mean(found.means.variances[..., 0] / variances) == pytest.approx(1.0, abs=0.1)


@PROJECTIONS
def test_the_silhouette_of_a_sphere(projection: str) -> None:
    """An iso-surface of the squared radius, which is interpolated within 0.75: the radius to a fiftieth of a voxel."""
    num, radius = 48, 18.0
    along = np.arange(num) - (num - 1) / 2
    squared = along**2 + (along**2)[:, None] + (along**2)[:, None, None]
    affine = np.eye(4)
    affine[:3, 3] = along[0]
    transfer = transfer_of((0.0, RED, OPAQUE), (radius**2, RED, OPAQUE), (radius**2, RED, 0.0), (1e4, RED, 0.0))
    view = look((0.0, 0.0, 0.0), 100.0, SIZE, projection=projection, field_of_view=24.0)
    seen = picture_of(Traced(TrueLayer(volume(squared, affine), transfer)), view)
    share = (seen.means.colors[..., 0] - BLUE[0]) / (RED[0] - BLUE[0])
    # Interpolated values are too large by 0.5 on average: an eighth from each of three axes, and as much at corners.
    inner = math.sqrt(radius**2 - 0.5)
    shown = inner * (100.0 / math.sqrt(100.0**2 - inner**2) if projection == "perspective" else 1.0)
    in_pixels = shown * view.scale_px / (100.0 if projection == "perspective" else 1.0)
    assert share.sum() == pytest.approx(math.pi * in_pixels**2, rel=0.005)


@pytest.mark.parametrize("width_px", [0.1, 0.3, 1.0])
def test_thin_wires(width_px: float) -> None:
    """A wire adds as much light as it covers, also where the first rays of a pixel miss it."""
    normal, view = np.array([math.sin(1.2), math.cos(1.2)]), look((0.0, 0.0, 0.0), 9.0, SIZE)
    middle = float(normal @ (np.array(SIZE) / 2 + 0.37))
    shares = coverage([(normal, middle + width_px / 2), (-normal, width_px / 2 - middle)])
    rays, totals, errors, found_shares = Painted(lambda at: abs(at @ normal - middle) < width_px / 2), [], [], []
    on_wire = shares > width_px / 4
    for seed in range(40):
        found = picture_of(rays, view, (0.0, 0.0, 0.0), seed)
        totals.append(found.means.colors[..., 0].sum())
        errors.append(found.means.colors[..., 0] - shares)
        found_shares.append(np.mean(found.num_rays[on_wire] >= 128))
        assert np.array_equal(found.is_seen, found.means.colors[..., 0] > 0)
    assert np.mean(found_shares) > (0.9 if width_px < 0.3 else 0.999)
    assert abs(np.mean(totals) - shares.sum()) < 4 * np.std(totals) / math.sqrt(len(totals))
    rms = math.sqrt(np.mean(np.square(errors)[:, on_wire]))
    assert rms < {0.1: 0.08, 0.3: 0.02, 1.0: 0.02}[width_px]


def test_squared_errors_have_no_bias() -> None:
    """Of many seeds: the squared difference without the variance is the squared error, however few the rays."""
    view = look((0.0, 0.0, 0.0), 9.0, SIZE)
    normal = np.array([math.sin(0.4), math.cos(0.4)])
    middle = float(normal @ np.array(SIZE) / 2)
    shares = coverage([(normal, middle)])
    rays = Painted(lambda at: at @ normal < middle)
    one_ray = rays.integrate(view, pixel_centres(SIZE), 1.0)[:, 0].reshape(SIZE[::-1])
    nearly = shares + 0.01 * np.random.default_rng(1).standard_normal(shares.shape)
    pixels, behind = np.flatnonzero((shares > 0) & (shares < 1)), np.zeros((SIZE[0] * SIZE[1], 3))
    for sides in (np.full(pixels.size, 1), np.full(pixels.size, 2), 1 + np.arange(pixels.size) % 3):
        for picture in (one_ray.ravel()[pixels], nearly.ravel()[pixels]):
            found = []
            for seed in range(400):
                places = places_in_pixels(pixels, SIZE[0], sides, 2, (seed,))
                means = means_over(rays.integrate(view, places.reshape(-1, 2), 1.0), behind[pixels], sides)
                found.append(np.mean((picture[:, None] - means.colors) ** 2 - means.variances))
            expected = np.mean((picture - shares.ravel()[pixels]) ** 2)
            assert abs(np.mean(found) - expected) < 4 * np.std(found) / math.sqrt(len(found))
            assert np.std(found) / math.sqrt(len(found)) < 0.02 * 0.25  # of the variance of one ray


def test_colours_are_clipped_before_they_are_averaged() -> None:
    """Of light that adds up, a ray may be brighter than white; a pixel half of which it fills is half as bright."""
    radiance = np.array([[3.0, 0.5, 0.0, 1.0], [0.0, 0.0, 0.0, 0.0]])
    means = means_over(radiance, np.array([[0.0, 0.0, 0.2]]), np.ones(1, np.int64))
    np.testing.assert_allclose(means.colors, [[0.5, 0.25, 0.1]])
    np.testing.assert_allclose(means.variances, [[0.25, 0.0625, 0.01]])
    assert isinstance(means, PixelMeans)


def test_places_lie_in_their_squares_and_follow_from_the_pixel() -> None:
    pixels = np.array([0, 5, 7, 5, 23, 5])
    sides = np.full(6, 3)
    places = places_in_pixels(pixels, 4, sides, 2, (7, 1)).reshape(6, 9, 2, 2)
    squares = np.floor(places * 3).astype(int)
    for axis, (of_pixels, of_squares) in enumerate(((pixels % 4, np.arange(9) % 3), (pixels // 4, np.arange(9) // 3))):
        expected = (of_pixels * 3)[:, None, None] + of_squares[:, None]
        np.testing.assert_array_equal(squares[..., axis], np.broadcast_to(expected, (6, 9, 2)))
    assert len(np.unique(places.reshape(-1, 2), axis=0)) == places.size // 2  # a pixel twice has other places
    mixed = places_in_pixels(pixels[1:4], 4, np.array([3, 1, 3]), 2, (7, 1))
    np.testing.assert_array_equal(mixed[[*range(9), *range(10, 19)]], places[[1, 3]].reshape(18, 2, 2))
    for other in ((7, 2), (8, 1), (7,), (7, 1, 0)):
        assert not np.any(places_in_pixels(pixels, 4, sides, 2, other) == places.reshape(-1, 2, 2))
    many = places_in_pixels(np.arange(40_000), 200, np.ones(40_000, np.int64), 1, (3,)).reshape(-1, 2) % 1.0
    counts, *_ = np.histogram2d(*many.T, bins=10, range=[[0, 1], [0, 1]])
    assert np.sum((counts - 400) ** 2 / 400) < 150  # chi squared of 99 degrees, 1e-3
    neighbours = np.corrcoef(many[:-1, 0], many[1:, 0])[0, 1]
    assert abs(neighbours) < 4 / 200


def test_the_picture_depends_on_the_seed_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither on the threads nor on how many rays are integrated at once; the shares that are told rise to 1."""
    box, transfer = even()
    view, shares = look((0.1, -0.2, 0.1), 16.0, SIZE, field_of_view=28.0), list[float]()
    one = picture_of(Traced(TrueLayer(box, transfer)), view)
    monkeypatch.setattr("renderer.truth.pixel_means._RAYS_AT_ONCE", 1000)
    rays: Any = Traced(TrueLayer(box, transfer))
    again = mean_over_pixels(rays, view, BLUE, 1e-6, seed=(0,), on_progress=shares.append)
    assert again.means.colors.tobytes() == one.means.colors.tobytes()
    assert again.means.variances.tobytes() == one.means.variances.tobytes()
    assert sum(again.convergence.num_rays) == sum(one.convergence.num_rays)
    assert shares[-1] == 1.0 and 0 < shares[0] < 0.1
    other = picture_of(Traced(TrueLayer(box, transfer)), view, seed=1)
    assert not np.array_equal(other.means.colors, one.means.colors)
