"""Densities are solved so that each layer has its part of the picture, and the rays are those of a turntable."""

from __future__ import annotations

import math

import numpy as np
import pytest
from kinds_of_data import Array, ball, sample_of, volume_of

from renderer.statistics import compute_statistics, fill_with_background, sample_volume
from renderer.suggest import Layer, Plane, TurntableRays, are_beyond, cast_rays, measure_visibility, solve_depths
from renderer.volume import Volume


def band(low: float, high: float, **options: float) -> Layer:
    return Layer("", ((low, 0.0), (low, 1.0), (high, 1.0), (high, 0.0)), **options)


def nested_balls() -> Array:
    """0 around a ball of 1 around one of 2."""
    return ball((0, 0, 0), 0.9).astype(float) + ball((0, 0, 0), 0.5)


def test_visibility_of_two_slabs_is_that_of_lamberts_law() -> None:
    """A ray through 30 samples of one material and then 20 of another."""
    values = np.repeat([[np.nan, 0.25, 0.75]], 3, axis=0).astype(np.float32).repeat([4, 30, 20], axis=1)
    rays = TurntableRays(values, 0.002, is_interpolated=True)
    found = measure_visibility(rays, [band(0.2, 0.3), band(0.7, 0.8)], np.array([0.1, 0.4]))
    # Of the step from one to the other, a tenth lies in either layer.
    first, second = 29.1 * 0.2 * 0.1, 19.1 * 0.2 * 0.4
    shown = np.array([1 - math.exp(-first), math.exp(-first) * (1 - math.exp(-second))])
    np.testing.assert_allclose(found.shares, shown / shown.sum(), rtol=1e-3)
    assert found.coverage == pytest.approx(1 - math.exp(-first - second), rel=1e-5)


@pytest.mark.parametrize("share", [0.7, 0.8, 0.9])
def test_each_layer_gets_its_share(share: float) -> None:
    layers = [band(0.4, 0.6, share=share), band(0.9, 1.1, share=1 - share)]
    rays = cast_rays(sample_of(nested_balls()))
    found = measure_visibility(rays, layers, solve_depths(rays, layers, 0.6))
    np.testing.assert_allclose(found.shares, [share, 1 - share], atol=0.02)
    assert found.coverage == pytest.approx(0.6, abs=0.02)


def test_a_small_layer_inside_of_others_gets_a_share_by_its_area() -> None:
    """The inner ball has 31 % of the area of the outer one."""
    layers = [band(0.4, 0.6), band(0.9, 1.1)]
    rays = cast_rays(sample_of(nested_balls()))
    outer, inner = measure_visibility(rays, layers, solve_depths(rays, layers, 0.6, by_area=True)).shares
    assert inner / outer == pytest.approx((0.5 / 0.9) ** 2, rel=0.1)


def test_densities_stay_within_their_bounds() -> None:
    layers = [band(0.4, 0.6, min_depth=0.5, max_depth=0.6), band(0.9, 1.1, min_depth=0.7, max_depth=0.9)]
    outer, inner = solve_depths(cast_rays(sample_of(nested_balls())), layers, 0.1)
    assert 0.5 <= outer <= 0.6 and 0.7 <= inner <= 0.9


def test_a_layer_that_no_ray_meets_can_be_seen() -> None:
    layers = [band(0.4, 0.6), band(0.7, 0.8)]
    depths = solve_depths(cast_rays(sample_of(nested_balls())), layers, 0.9)
    assert depths[1] >= 0.5


def test_chords_of_a_ball() -> None:
    """The mean length of the rays through a ball is four thirds of its radius."""
    values = ball((0, 0, 0), 0.9, 96).astype(float)
    rays = cast_rays(sample_of(values))
    lengths = (rays.values > 0.5).sum(axis=1) * rays.step * math.sqrt(3) * 96
    assert lengths[lengths > 0].mean() == pytest.approx(4 / 3 * 0.9 * 47.5, rel=0.02)


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e9])
def test_the_unit_of_length_does_not_matter(scale: float) -> None:
    one, other = cast_rays(sample_of(nested_balls())), cast_rays(sample_of(nested_balls(), scale))
    np.testing.assert_array_equal(one.values, other.values)
    assert one.step == pytest.approx(other.step)


def test_rays_turn_around_the_axis_of_the_world() -> None:
    """A rod along z of the world is seen from the side, whichever axis of the voxels lies along it."""
    values = np.zeros((48, 24, 24))
    values[:, 10:14, 10:14] = 1
    upright = cast_rays(sample_of(values))
    turned = volume_of(np.ascontiguousarray(values.transpose(2, 1, 0)))
    swapped = np.eye(4)[:, [2, 1, 0, 3]]
    lying = Volume(**{**vars(turned), "world_from_index": swapped})
    sample = sample_volume(lying, compute_statistics(lying.values))
    met = [float((rays.values > 0.5).any(axis=1).mean()) for rays in (upright, cast_rays(sample))]
    assert met[0] == pytest.approx(met[1], rel=0.1)


def test_what_planes_clip_away_is_not_seen() -> None:
    sample = sample_of(nested_balls())
    planes = [Plane(np.zeros(3), np.array([1.0, 0.0, 0.0]))]
    whole, half = cast_rays(sample), cast_rays(fill_with_background(sample, are_beyond(sample, planes)))
    assert np.nansum(half.values) == pytest.approx(np.nansum(whole.values) / 2, rel=0.05)


def test_mean_weights_are_integrals() -> None:
    """Against sums over many values between the two."""
    layer = Layer("", ((0.2, 0.0), (0.3, 1.0), (0.3, 0.4), (0.6, 0.8)))
    one, other = np.random.Generator(np.random.PCG64(3)).uniform(-0.1, 1.1, (2, 50))
    shares = (np.arange(20_000) + 0.5)[:, None] / 20_000
    np.testing.assert_allclose(
        layer.mean_weights(one, other), layer.weights(one + shares * (other - one)).mean(axis=0), atol=1e-4
    )
    np.testing.assert_array_equal(layer.mean_weights(one, one), layer.weights(one))


def test_ranges_of_a_layer() -> None:
    assert band(0.2, 0.4).ranges() == [(0.2, 0.4)]
    assert Layer("", ((0.3, 0.0), (0.5, 1.0))).ranges() == [(0.3, math.inf)]
    both = Layer("", ((0.1, 0.0), (0.2, 1.0), (0.3, 0.0), (0.7, 0.0), (0.8, 1.0), (0.9, 0.0)))
    assert both.ranges() == [(0.1, 0.3), (0.7, 0.9)]
