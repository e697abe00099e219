"""Tests of flicker: how much the error of a pixel, and of a block of pixels, changes from one frame to the next."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.accuracy import Flicker, PictureErrors, measure_flicker, pool_flickers, with_a_neighbour
from renderer.volume import Array

SHAPE = (20, 30, 3)


def errors(frame: int, of: Array | float, *, variance: float = 0.0, on_volume: Array | None = None) -> PictureErrors:
    seen = np.ones(SHAPE[:2], np.bool_) if on_volume is None else on_volume
    return PictureErrors(frame, np.broadcast_to(np.float64(of), SHAPE), np.full(SHAPE, variance), seen)


def test_an_error_that_stays_is_none_whatever_moves() -> None:
    """The truths differ in every pixel."""
    random = np.random.default_rng(1)
    stays = random.normal(0, 0.1, SHAPE)
    truths = random.random((2, *SHAPE))
    before, after = (errors(frame, (truth + stays) - truth) for frame, truth in enumerate(truths))
    found = measure_flicker(before, after)
    assert found is not None and max(found.rms, found.largest, found.block_largest) < 1e-10


def test_a_known_change_has_its_amplitude() -> None:
    """A fiftieth of the pixels of the object alternates by 40 levels in one channel."""
    on_volume = np.zeros(SHAPE[:2], np.bool_)
    on_volume[:, :20] = True
    change = np.zeros(SHAPE)
    change[::10, 3:7, 1] = 40 / 255
    change[:, 20:] = 1.0  # beside the object
    before, after = errors(4, 0.3, on_volume=on_volume), errors(5, 0.3 - change, on_volume=on_volume)
    found = measure_flicker(before, after)
    assert found is not None
    assert (found.p99, found.largest) == pytest.approx((40, 40))
    assert found.rms == pytest.approx(40 * np.sqrt(8 / 400 / 3))
    small = measure_flicker(errors(4, 0.0), errors(5, np.where(change == 1.0, 0.0, change)))
    assert small is not None and small.block_largest == pytest.approx(40 * 4 / 64)


def test_blocks_have_the_change_of_their_mean() -> None:
    """Pixels that change against each other cancel; blocks at the border are smaller."""
    alternating = np.indices(SHAPE[:2]).sum(axis=0)[..., None] % 2 - 0.5
    found = measure_flicker(errors(0, 0.0), errors(1, 0.1 * alternating))
    assert found is not None
    assert (found.p99, found.largest) == pytest.approx((0.05 * 255, 0.05 * 255))
    assert found.block_largest < 1e-10
    corner = np.zeros(SHAPE)
    corner[16:, 24:] = 0.1  # of 4 x 6 pixels
    found = measure_flicker(errors(0, 0.0), errors(1, corner))
    assert found is not None and found.block_largest == pytest.approx(25.5)


def test_the_errors_of_the_truths_are_taken_from_the_mean_square() -> None:
    random, deviation = np.random.default_rng(2), 0.02
    noise = random.normal(0, deviation, (2, *SHAPE))
    before, after = (errors(frame, each + 0.05 * frame, variance=deviation**2) for frame, each in enumerate(noise))
    found = measure_flicker(before, after)
    assert found is not None and found.rms == pytest.approx(0.05 * 255, rel=0.05)


def test_there_is_none_without_neighbours_or_without_an_object() -> None:
    nothing = np.zeros(SHAPE[:2], np.bool_)
    assert measure_flicker(errors(3, 0.1), errors(5, 0.2)) is None
    assert measure_flicker(errors(3, 0.1, on_volume=nothing), errors(4, 0.2, on_volume=nothing)) is None
    assert pool_flickers([]) is None


def test_several_pairs_count_alike() -> None:
    found = pool_flickers([Flicker(3.0, 10.0, 20.0, 1.0, 2.0), Flicker(4.0, 20.0, 60.0, 2.0, 5.0)])
    assert found == Flicker(pytest.approx(np.sqrt(12.5)), 15.0, 60.0, 1.5, 5.0)


@pytest.mark.parametrize(
    ("frames", "num_frames", "found"),
    [([0, 40, 80], 120, [0, 40, 41, 80]), ([0, 1, 2], 3, [0, 1, 2]), ([0], 1, [0]), ([0, 3], 4, [0, 3])],
)
def test_one_frame_more_makes_neighbours(frames: list[int], num_frames: int, found: list[int]) -> None:
    assert with_a_neighbour(frames, num_frames) == found
