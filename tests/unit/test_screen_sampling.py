"""Which pixels of an image of bricks are drawn at a tolerance, and where rays end."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from renderer.bricks import screen_sampling_at

MAX_TERMINATION_TRANSMITTANCE = 0.025

# In tolerances: the transmittance at which a ray ends, and its largest value.
TERMINATION_TRANSMITTANCE = 0.04

MAX_DIFFERENCE_THRESHOLD = 0.35

# In tolerances: nodes between which pixels are interpolated differ by at most so much.
DIFFERENCE_THRESHOLD = 0.35

TOLERANCES = np.geomspace(1e-4, 1e2, 61).tolist()
CELL_PX = [1e-3, 0.3, 1.0, 2.0, 5.0, 40.0, 1e6]


@pytest.mark.parametrize(
    ("tolerance", "cell_px", "strides"),
    [
        (0.0, 1.0, (1,)),
        (0.15, 1.9, (1,)),  # nodes four pixels apart would be more than 1.35 * 1.5 cells apart
        (0.15, 2.0, (2, 1)),
        (0.3, 0.98, (1,)),
        (0.3, 1.0, (2, 1)),  # every fourth cell
        (0.59, 1.0, (2, 1)),
        (0.6, 1.0, (4, 1)),
        (1.0, 0.29, (1,)),
        (1.0, 0.4, (4, 2)),
        (2.0, 0.29, (4, 2)),
        (2.0, 0.4, (8, 4)),
        (1e3, 1e-6, (1,)),
    ],
)
def test_strides_of_the_subsampled_grids(tolerance: float, cell_px: float, strides: tuple[int, ...]) -> None:
    """Drawn pixels are at most 1.35 cells apart for each tenth of the tolerance."""
    spread = min(DIFFERENCE_THRESHOLD * tolerance, MAX_DIFFERENCE_THRESHOLD) if len(strides) > 1 else 0.0
    found = screen_sampling_at(tolerance, cell_px)
    assert (found.strides, found.difference_threshold) == (strides, spread)
    assert found.termination_transmittance == min(TERMINATION_TRANSMITTANCE * tolerance, MAX_TERMINATION_TRANSMITTANCE)


@pytest.mark.parametrize(
    ("tolerance", "cell_px", "contrast", "spread"),
    [
        (0.1, 3.0, 0.15, 0.6),
        (0.1, 1.0, 0.15, 0.6),
        (0.1, 0.25, 0.075, 0.3),
        (0.0, 1.0, 0.5 / 255, 2 / 255),
        (1e300, 1.0, 1.5e30, 6e30),
    ],
)
def test_contrasts_of_pixels_with_several_rays(tolerance, cell_px: float, contrast: float, spread: float) -> None:
    """In proportion to the tolerance, and to the root of cells below a pixel; half a level or more, in float32."""
    found = screen_sampling_at(tolerance, cell_px)
    assert (found.contrast_threshold, found.spread_threshold) == pytest.approx((contrast, spread))


@pytest.mark.parametrize(
    ("tolerance", "cell_px", "is_scouted"),
    [(0.1, 0.9, True), (0.149, 0.1, True), (0.15, 0.1, False), (0.1, 1.0, False)],
)
def test_pixels_larger_than_cells_are_scouted_at_fine_tolerances(
    tolerance: float, cell_px: float, is_scouted: bool
) -> None:
    assert screen_sampling_at(tolerance, cell_px).is_scouted == is_scouted


def test_a_stride_is_at_most_half_of_the_thinnest_side() -> None:
    """At least two drawn pixels lie on the volume's thinnest side."""
    found = [screen_sampling_at(2.0, 5.0, thinnest_px).strides for thinnest_px in (7.9, 8.0, 15.9, 16.0)]
    assert found == [(1,), (4, 2), (4, 2), (8, 4)]


def test_coarser_tolerances_and_larger_cells_draw_no_more_pixels() -> None:
    for tolerance in TOLERANCES:
        for small, large in pairwise(CELL_PX):
            assert screen_sampling_at(tolerance, small).strides[0] <= screen_sampling_at(tolerance, large).strides[0]
    for cell_px in CELL_PX:
        for fine, coarse in pairwise(TOLERANCES):
            first, last = screen_sampling_at(fine, cell_px).strides, screen_sampling_at(coarse, cell_px).strides
            assert first[0] <= last[0] and first[-1] <= last[-1]
            assert all(a % b == 0 and a > b for a, b in pairwise(last))
