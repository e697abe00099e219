"""Tests of flicker: how much the error of a pixel, and of a block of pixels, changes from one frame to the next."""

from __future__ import annotations

import numpy as np
import pytest

from renderer.accuracy import (
    EncodingErrors,
    Flicker,
    PictureErrors,
    SharedErrors,
    error_products,
    error_samples,
    estimate_flicker,
    first_of_pair,
    measure_flicker,
    pool_flickers,
    psnr,
    shared_pixels,
    with_a_neighbour,
)
from renderer.record import FrameAccuracy, FrameRecord, SharedProbes, film_accuracy, flicker_text, with_encoding_errors
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
    change[:, 20:] = 0.5  # beside the object
    before, after = errors(4, 0.3, on_volume=on_volume), errors(5, 0.3 - change, on_volume=on_volume)
    found = measure_flicker(before, after)
    assert found is not None
    assert (found.p99, found.largest) == pytest.approx((40, 40))
    assert found.rms == pytest.approx(np.sqrt((40**2 * 8 / 3 + 127.5**2 * 200) / 600))  # of all pixels
    small = measure_flicker(errors(4, 0.0), errors(5, np.where(change == 0.5, 0.0, change)))
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


# By probes that two frames share


@pytest.mark.parametrize("num_frames", [1, 2, 3, 4, 36, 120, 1000])
def test_a_path_has_pairs_of_frames_that_share_probes(num_frames: int) -> None:
    """They begin at even and at odd frames, so that they are not in step with what moves in steps."""
    found = [first_of_pair(frame, num_frames) for frame in range(num_frames)]
    firsts = sorted({first for first in found if first is not None})
    assert all([found[first], found[first + 1]] == [first, first] for first in firsts)
    assert sum(first is not None for first in found) == 2 * len(firsts)
    assert min(num_frames // 3, 50) <= len(firsts) <= 64
    assert num_frames < 36 or {first % 2 for first in firsts} == {0, 1}
    assert (num_frames < 2) == (not firsts)


def test_shared_probes_are_chosen_evenly() -> None:
    numbers = np.concatenate([shared_pixels(3, 100, 7, seed).numbers for seed in range(2000)])
    counts = np.bincount(numbers, minlength=100)
    assert counts.min() > 90 and counts.max() < 190
    one, two = shared_pixels(3, 100, 7, 0), shared_pixels(4, 100, 7, 0)
    assert not np.array_equal(one.numbers, two.numbers)
    assert set(shared_pixels(0, 100, 50, 0).channels) == {0, 1, 2}


@pytest.mark.parametrize(("sign", "changes"), [(1, 0.0), (-1, 2.0), (0, np.sqrt(2))])
def test_known_errors_have_their_change(sign: int, changes: float) -> None:
    """The same error in both frames, one that alternates, and one that is elsewhere in the other frame."""
    half = np.tile([0.1, 0.0], 200)
    after = sign * half if sign else np.roll(half, 1)
    products = error_products(SharedErrors(6, tuple(half)), SharedErrors(6, tuple(after)))
    assert products is not None
    rms, (low, high) = estimate_flicker(error_samples(np.concatenate([half, after]) ** 2), products)
    assert rms == pytest.approx(changes * np.sqrt(0.005))
    assert low <= rms <= high <= 2.3 * np.sqrt(0.005)
    assert low == 0.0 or sign != 1


def test_probes_that_are_drawn_over_do_not_count() -> None:
    before, after = SharedErrors(0, (0.1, 0.2, float("nan"))), SharedErrors(0, (0.3, float("nan"), 0.1))
    products = error_products(before, after)
    assert products is not None and (products.num, products.mean) == (1, pytest.approx(0.03))
    assert error_products(SharedErrors(0, (float("nan"),)), SharedErrors(0, (0.1,))) is None


@pytest.mark.parametrize("alike", [-0.5, 0.0, 0.6, 0.98])
@pytest.mark.parametrize("num", [16, 200, 1000])
def test_intervals_hold_where_few_pixels_have_most_of_the_error(alike: float, num: int) -> None:
    """One of ten pixels has an error, of very different sizes, seen with the errors of the rays of each frame.

    Seven of ten other probes are at one of them.
    """
    random, held = np.random.default_rng(5), 0
    sizes = np.where(random.random(20_000) < 0.1, random.lognormal(-4.5, 0.6, 20_000), 0.0)
    off = np.flatnonzero(sizes)
    chances = np.where(sizes > 0, 0.7 * 20_000 / off.size + 0.3, 0.3)
    first, other = random.normal(size=(2, 20_000))
    both = sizes * np.stack([first, alike * first + np.sqrt(1 - alike**2) * other])
    exact = np.sqrt(np.mean((both[1] - both[0]) ** 2))
    for _ in range(400):
        shared = random.integers(20_000, size=num)
        rays = random.normal(0, 0.4, (2, num)) * sizes[shared]
        products = error_products(*(SharedErrors(0, tuple(each)) for each in both[:, shared] + rays))
        assert products is not None
        others = np.where(
            random.random(6 * num) < 0.7, random.choice(off, 6 * num), random.integers(20_000, size=6 * num)
        )
        squares = both[np.arange(6 * num) % 2, others] ** 2 / chances[others]
        _, (low, high) = estimate_flicker(error_samples(squares), products)
        held += low <= exact <= high
    assert held >= 0.93 * 400


def recorded(frame: int, first: int | None, errors: tuple[float, ...]) -> FrameRecord:
    """A frame with a root mean squared error of 10 levels."""
    error = (10 / 255) ** 2
    shared = None if first is None else SharedProbes(first, errors)
    accuracy = FrameAccuracy(psnr(error), (20.0, 40.0), 400, 0.0, error, 0.1, error, shared)
    return FrameRecord(frame, 0.1, 1, 1, {}, accuracy=accuracy)


def test_a_film_has_the_flicker_of_the_pairs_that_are_whole() -> None:
    """A part ends between frames 4 and 5, and frame 7 was probed with another number of rays."""
    alternating = [
        recorded(0, 0, (10.0,) * 90),
        recorded(1, 0, (-10.0,) * 90),
        recorded(2, None, ()),
        recorded(4, 4, (10.0,) * 90),
        recorded(6, 6, (10.0,) * 90),
        recorded(7, 6, (10.0,) * 80),
    ]
    accuracy = film_accuracy(alternating)
    assert accuracy is not None and accuracy.flicker is not None
    assert (accuracy.flicker.pairs, accuracy.flicker.probes) == (1, 90)
    assert accuracy.flicker.rms == pytest.approx(20.0)
    assert accuracy.flicker.interval[0] < 20.0 <= accuracy.flicker.interval[1] < 25.0
    assert str(flicker_text(accuracy)).startswith("file flicker 20.0 of 255 levels (")
    encoded = with_encoding_errors(accuracy, EncodingErrors(1e-5), 4, None)
    assert str(flicker_text(encoded)).startswith("frames flicker 20.0 of 255 levels (")
    whole = film_accuracy([*alternating[:4], recorded(5, 4, (10.0,) * 90), *alternating[4:]])
    assert whole is not None and whole.flicker is not None and whole.flicker.pairs == 2
    assert whole.flicker.rms == pytest.approx(np.sqrt(200.0))
    without = film_accuracy(alternating[2:])
    assert without is not None and without.flicker is None
