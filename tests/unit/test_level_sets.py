"""A surface at 0 is shown where a field was made for it, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from kinds_of_data import axes, blurred, noise, suggested

from renderer.statistics import compute_statistics
from renderer.suggest import suggest
from renderer.volume import Array, make_volume


def radius(z0: float = 0.0, y0: float = 0.0, x0: float = 0.0) -> Array:
    z, y, x = axes()
    return np.sqrt((z - z0) ** 2 + (y - y0) ** 2 + (x - x0) ** 2)


def random_field() -> Array:
    """Smooth, of deviation 1 about 0."""
    values = noise(8)
    for _ in range(12):
        values = blurred(values)
    return np.asarray((values - values.mean()) / values.std())


def marked(values: Array, with_value: float) -> Array:
    values = values.copy()
    values[20, 22, 24] = with_value
    return values


def overshooting() -> Array:
    """A scan of tissues that fill the volume, with a dark vessel along z whose edge overshoots below 0."""
    _, y, x = axes()
    tissue = 500 + 60 * random_field()
    distance = np.hypot(y - 0.1, x + 0.2)
    return np.rint(np.where(distance < 0.08, -40.0, tissue) + 3 * noise(10)).astype(np.int16)


def ellipsoid_at_the_border(z0: float) -> Array:
    """An ellipsoid's equation, around a centre at z0."""
    z, y, x = axes()
    return ((z - z0) / 0.75) ** 2 + (y / 0.5) ** 2 + (x / 0.5) ** 2 - 1


DISTANCES = {
    "a ball": radius() - 0.5,
    "a small ball": radius(0.3, -0.2, 0.4) - 0.1,
    "a torus": np.hypot(np.hypot(axes()[1], axes()[2]) - 0.6, axes()[0]) - 0.1,
    "forty small balls": np.min(
        [radius(*at) for at in np.random.Generator(np.random.PCG64(3)).uniform(-0.8, 0.8, (40, 3)).tolist()], axis=0
    )
    - 0.1,
    "whole numbers": np.rint(40 * (radius() - 0.6)).astype(np.int8),
}
OTHER_LEVEL_SETS = {
    "a sphere's equation": radius() ** 2 - 0.25,
    "an ellipsoid's equation": axes()[0] ** 2 + 2 * axes()[1] ** 2 + 4 * axes()[2] ** 2 - 0.8,
    "an ellipsoid that meets the border, five times more frequent inside": ellipsoid_at_the_border(-0.5),
}
NO_LEVEL_SETS = {
    "one voxel of a smooth field": marked(random_field() + 6, -0.01),
    "one voxel of whole numbers": marked(np.rint(200 * random_field() + 1500).astype(np.int16), -1),
    "one voxel of a distance to what is not closed": marked(radius(), -1.0),
    "valleys of a random field": random_field() + 2.5,
    "one slice of a random field": (random_field() + 2.5)[:1],
    "noise": 300 + 120 * noise(9),
    "half an ellipsoid, three times more frequent inside": ellipsoid_at_the_border(-0.72),
    "an edge that overshoots": overshooting(),
    "a cold core": 20 + 3 * random_field() - 40 * np.exp(-(radius() ** 2) / 0.01),
    "ice in a room": 20 + 4 * axes()[0] + axes()[1] - 40 * np.exp(-(radius() ** 2) / 0.03),
}


@pytest.mark.parametrize("name", DISTANCES | OTHER_LEVEL_SETS)
@pytest.mark.parametrize("sign", [1, -1])
def test_level_sets_are_recognised(name: str, sign: int) -> None:
    assert suggested(sign * (DISTANCES | OTHER_LEVEL_SETS)[name]).kind == "level set"


def test_distances_are_recognised_where_voxels_are_no_cubes() -> None:
    """Whether they are in the unit of the world or in voxels."""
    z, y, x = axes()
    for values in (np.sqrt((4 * z) ** 2 + y**2 + x**2) - 0.15, radius() - 0.15):
        volume = make_volume(values, np.diag([1.0, 1.0, 4.0, 1.0]), "made up")
        assert suggest(volume, compute_statistics(values)).kind == "level set"


@pytest.mark.parametrize("name", NO_LEVEL_SETS)
@pytest.mark.parametrize("sign", [1, -1])
def test_a_few_voxels_beyond_0_make_no_level_set(name: str, sign: int) -> None:
    values = sign * NO_LEVEL_SETS[name]
    assert values.min() < 0 < values.max()
    assert suggested(values).kind != "level set"


def test_one_voxel_changes_nothing() -> None:
    values = random_field() + 6
    assert suggested(values).kind == suggested(marked(values, -0.01)).kind == "filled volume"
