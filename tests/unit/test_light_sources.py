"""The sources of light, and the albedos of colours, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.lighting import LightSources, environment_radiance, key_radiance, key_solid_angle
from renderer.transfer import TransferFunction, albedo_of_thick, albedos_of, linear_of_srgb

UP = (0.6, 0.0, 0.8)
SKY = np.array([[0.5, 0.6, 0.7], [0.2, 0.1, 0.0], [0.1, -0.1, 0.05]])


def sources_of(environment: object = SKY, radius: float = 14.0) -> LightSources:
    return LightSources(UP, np.array(environment, np.float64), (0.0, 0.0, 1.0), radius, np.array([3.0, 2.0, 1.0]))


def test_environment_has_its_bands() -> None:
    up, across = np.array(UP), np.array([0.8, 0.0, -0.6])
    found = environment_radiance(sources_of(), np.stack([up, across, -up]))
    expected = np.array([[1, 1, 1], [1, 0, -0.5], [1, -1, 1]]) @ SKY
    np.testing.assert_allclose(found, expected, atol=1e-15)


def test_environment_is_nowhere_negative() -> None:
    found = environment_radiance(sources_of([[0.1] * 3, [1.0] * 3, [0.0] * 3]), np.array([UP, [-0.6, 0.0, -0.8]]))
    np.testing.assert_allclose(found, [[1.1] * 3, [0.0] * 3])


@pytest.mark.parametrize("radius", [0.01, 14.0, 90.0])
def test_key_light_has_its_irradiance(radius: float) -> None:
    sources = sources_of(radius=radius)
    cosines = np.linspace(np.cos(np.radians(radius)), 1, 3)
    assert key_solid_angle(sources) == pytest.approx(2 * np.pi * (cosines[-1] - cosines[0]), rel=1e-6)
    np.testing.assert_allclose(key_radiance(sources) * key_solid_angle(sources), [3.0, 2.0, 1.0])


def test_thick_matter_shows_its_colour() -> None:
    """By Chandrasekhar's H function: a half-space in even light shows 1 - sqrt(1 - w) H(1) of it, seen straight, and
    1 - 2 sqrt(1 - w) times the first moment of H over all cosines, which the fit is for.
    """
    for albedo in (0.2, 0.5, 0.9, 0.99):
        nodes, weights = np.polynomial.legendre.leggauss(80)
        mu, weights = (nodes + 1) / 2, weights / 2
        h = np.ones_like(mu)
        for _ in range(1000):
            h = 1 / (np.sqrt(1 - albedo) + albedo / 2 * (weights * mu * h / (mu[:, None] + mu)).sum(axis=1))
        shown = 1 - 2 * np.sqrt(1 - albedo) * float((weights * mu * h).sum())
        assert albedo_of_thick(shown) == pytest.approx(albedo, abs=0.01)
    np.testing.assert_allclose(albedo_of_thick([0.0, 1.0]), [0.0, 1.0], atol=1e-12)


def test_clear_matter_shows_its_albedo() -> None:
    colors = np.array([[1.0, 0.5, 0.0]] * 3)
    found = albedos_of(TransferFunction(np.arange(3.0), colors, np.array([0.0, 0.5, 80.0]), 1.0), 2.0)
    linear = linear_of_srgb(colors[0])
    thick = albedo_of_thick(linear)
    assert linear[1] == pytest.approx(0.21404114)
    shown, _ = found.classify(np.arange(3.0))
    np.testing.assert_allclose(shown, [linear, linear + (1 - np.exp(-1)) * (thick - linear), thick], atol=1e-15)
    assert thick[1] > 0.6


def test_albedos_follow_the_opacity_between_control_points() -> None:
    """On a ramp to an opaque voxel, all but its lowest end is opaque; extinctions and other points stay as they are."""
    orange = np.array([[1.0, 0.5, 0.0]] * 4)
    ramp = TransferFunction(np.array([0.0, 1.0, 2.0, 2.0]), orange, np.array([0.0, 40.0, 0.0, 40.0]), 1.0)
    found, scalars = albedos_of(ramp, 1.0), np.linspace(-1, 3, 401)
    colors, extinctions = found.classify(scalars)
    np.testing.assert_allclose(extinctions, ramp.classify(scalars)[1], atol=1e-12)
    opacity = 1 - np.exp(-extinctions)
    linear = linear_of_srgb(orange[0])[1]
    np.testing.assert_allclose(
        colors[:, 1], linear + opacity * (albedo_of_thick(linear) - linear), atol=0.06 * albedo_of_thick(linear)
    )
    assert np.all(np.diff(found.values) >= 0)
