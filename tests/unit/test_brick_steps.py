"""The samples of a ray in a brick are bounded, whatever its step error estimate and the tolerance."""

from __future__ import annotations

import math

import numpy as np
import pytest
from brick_reference import DITHER

from renderer.bricks import BRICK_SIZE, step_sizes

# The shortest step, in cells of a brick.
MIN_STEP = 1 / 128

# From corner to corner of a brick, in the shortest steps, with the jitter that adds samples.
MOST_SAMPLES = 3814


@pytest.mark.parametrize("depth", [0.0, 1.0, 40.0, 1e300])
@pytest.mark.parametrize("tolerance", [0.0, 5e-324, 1e-6, 0.3, 1e300, math.inf])
def test_samples_of_a_ray_in_a_brick_are_bounded(tolerance: float, depth: float) -> None:
    step_errors = np.array([0.0, 5e-324, 1e-9, 1.0, 1e9, 1.7e308])
    steps = step_sizes(step_errors, tolerance, np.full(6, depth))
    assert np.isfinite(steps).all()
    samples = _most_parts(float(steps.min()))
    assert samples <= MOST_SAMPLES == _most_parts(MIN_STEP)


def _most_parts(step: float) -> int:
    """Return the number of segments at a jitter of 1, which no pixel has."""
    return math.floor(BRICK_SIZE * math.sqrt(3) / step * (1 + DITHER / 2) + 1.5)
