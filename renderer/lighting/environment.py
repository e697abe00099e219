"""Define the sources of light around the object: an environment that changes slowly with direction, and a key light.

All radiances are linear. The environment is a sum of Legendre polynomials P0, P1 and P2 of the cosine between a
direction and an axis, and nowhere below 0. The key light is a disc of even radiance, at an infinite distance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from renderer.scene import SurfaceSpec, Vector
from renderer.volume import Float64


class LightSources(NamedTuple):
    """The sources of light around the object, in world axes and linear light, and how surfaces reflect their light."""

    # The axis of the environment, a unit vector.
    up: Vector
    # [band, rgb]: the coefficients of the environment's radiance. Band l has the factor P_l(cosine).
    environment: Float64
    # The unit vector to the middle of the key light.
    key: Vector
    # The angular radius of the key light, in degrees: half of the angle that it fills. Above 0, at most 90.
    key_radius: float
    # [rgb]: the integral of the key light's radiance over its solid angle; 0 without a key light.
    key_irradiance: Float64
    # The factor on albedos of matter that light meets on its way, from 0 to 1; points of rays have their whole albedo.
    scattering: float = 1.0
    # How surfaces reflect light that reaches the eye; None if no point is a surface.
    surface: SurfaceSpec | None = None


def environment_radiance(sources: LightSources, directions: Float64) -> Float64:
    """Return the radiance that comes from the environment, float64 [..., 3].

    directions: unit vectors to places in the environment, [..., 3].
    """
    cosine = np.asarray(directions @ np.array(sources.up, np.float64))
    bands = np.stack([np.ones_like(cosine), cosine, 1.5 * cosine * cosine - 0.5], axis=-1)
    return np.maximum(bands @ sources.environment, 0.0)


def key_solid_angle(sources: LightSources) -> float:
    """Return the solid angle of the key light, in steradians."""
    return float(4 * np.pi * np.sin(np.radians(sources.key_radius) / 2) ** 2)


def key_radiance(sources: LightSources) -> Float64:
    """Return the radiance of every direction to the key light, float64 [3]."""
    return np.asarray(sources.key_irradiance / key_solid_angle(sources))
