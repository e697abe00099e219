"""The metrics of pictures whose difference is known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hsplat_cli.compare import COMPARISON_METRICS, FrameDifference
from renderer.accuracy import REACH_PX, SSIM_WINDOW_PX, compute_metric, metric_map
from renderer.volume import UInt8

Pixels = UInt8

GREY = np.full((32, 40, 3), 100, np.uint8)
LEVELS = ("largest", "p99", "densest", "bias")
NO_DIFFERENCE = pytest.approx({"largest": 0, "p99": 0, "flip": 0, "ssim": 1, "densest": 0, "bias": 0}, abs=1e-12)


def noise(shape: tuple[int, ...], seed: int = 0) -> Pixels:
    return np.random.default_rng(seed).integers(0, 256, shape, np.uint8)


def clear(color: tuple[int, int, int], alpha: int) -> Pixels:
    return np.broadcast_to(np.array([*color, alpha], np.uint8), (16, 16, 4)).copy()


@pytest.mark.parametrize("channels", [3, 4])
def test_equal_pictures_differ_by_nothing(channels: int) -> None:
    picture = noise((24, 33, channels))
    difference = FrameDifference(picture, picture.copy())
    assert difference.metrics(COMPARISON_METRICS) == NO_DIFFERENCE
    assert difference.bias == (0.0,) * channels
    assert not difference.signed_steps.any()


def test_a_constant_shift_has_the_same_error_in_every_metric() -> None:
    difference = FrameDifference(GREY, GREY - np.array([0, 3, 0], np.uint8))
    assert difference.metrics(LEVELS) == {"largest": 3.0, "p99": 3.0, "densest": 3.0, "bias": 3.0}
    assert difference.bias == (0.0, -3.0, 0.0)
    assert (difference.signed_steps == -3).all()


@pytest.mark.parametrize("name", ["flip", "ssim"])
@pytest.mark.parametrize("share", [1.0, 0.0])
def test_metrics_of_squares_add_up(name: str, share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsplat_cli.compare.frame_difference._BLOCK_PX", 32)
    golden, other = noise((65, 100, 3)), noise((65, 100, 3), 1)
    spoiled = np.random.default_rng(2).random((65, 100)) < share
    spoiled[31, 63] = spoiled[64, 0] = True  # at corners of squares, the second in one of a single row
    actual = np.where(spoiled[..., None], other, golden)
    expected = compute_metric(name, actual / 255, golden / 255)
    assert FrameDifference(golden, actual).perceptual_metric(name) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("name", ["flip", "ssim"])
def test_a_pixel_changes_perceptual_metrics_within_their_reach_only(name: str) -> None:
    golden = noise((64, 64, 3)) / 255
    actual = golden.copy()
    actual[30, 33] = 1 - actual[30, 33].round()
    perfect = float(COMPARISON_METRICS[name].higher_is_better)
    rows, columns = np.nonzero(np.abs(metric_map(name, actual, golden) - perfect) > 1e-12)
    reach = max(30 - rows.min(), rows.max() - 30, 33 - columns.min(), columns.max() - 33)
    assert 0 < reach <= REACH_PX


def test_one_pixel_counts_by_its_share_of_window_and_picture() -> None:
    actual = GREY.copy()
    actual[5, 7] += np.array([6, 0, 12], np.uint8)
    figures = FrameDifference(GREY, actual).metrics(LEVELS)
    assert figures == {"largest": 12.0, "p99": 0.0, "densest": 12 / 64, "bias": 12 / (32 * 40)}


@pytest.mark.parametrize("shape", [(20, 31), (8, 8), (8, 30), (1, 1), (3, 5), (3, 20)])
def test_the_densest_window_is_the_worst_of_all(shape: tuple[int, int]) -> None:
    """A picture that is not as high or as wide as the window has a smaller one."""
    golden, actual = noise((*shape, 3), 1), noise((*shape, 3), 2)
    errors, (height, width) = np.abs(actual.astype(float) - golden), (min(side, 8) for side in shape)
    means = [
        errors[row : row + height, column : column + width].mean(axis=(0, 1)).max()
        for row in range(shape[0] - height + 1)
        for column in range(shape[1] - width + 1)
    ]
    assert FrameDifference(golden, actual).densest() == pytest.approx(max(means), rel=1e-12)


def test_the_99th_percentile_leaves_out_the_worst_hundredth() -> None:
    golden = np.zeros((10, 101, 3), np.uint8)
    actual = golden.copy()
    actual[:, 0] = 200
    assert FrameDifference(golden, actual).p99() == 0
    actual[0, 1] = actual[0, 2] = 40  # 12 pixels of 1010
    assert FrameDifference(golden, actual).p99() == 40


def test_bias_is_of_the_most_shifted_channel_and_errors_cancel() -> None:
    actual = GREY.astype(int)
    actual[::2, :, 0] += 4
    actual[1::2, :, 0] -= 4
    actual[..., 2] -= 1
    difference = FrameDifference(GREY, actual.astype(np.uint8))
    assert difference.bias == (0.0, 0.0, -1.0)
    assert difference.metrics(["bias"]) == {"bias": 1.0}


# Alpha.


def test_colours_are_weighted_by_the_larger_alpha() -> None:
    difference = FrameDifference(clear((50, 0, 0), 51), clear((60, 0, 0), 51))
    assert difference.metrics(LEVELS) == {"largest": 2.0, "p99": 2.0, "densest": 2.0, "bias": 2.0}
    thin, dense = clear((100, 0, 0), 50), clear((200, 0, 0), 51)
    assert FrameDifference(thin, dense).bias == (20.0, 0.0, 0.0, 1.0)
    assert FrameDifference(dense, thin).bias == (-20.0, 0.0, 0.0, -1.0)
    assert FrameDifference(clear((0, 0, 0), 100), clear((0, 0, 0), 130)).densest() == 30  # of alpha alone
    invisible = FrameDifference(clear((1, 2, 3), 0), clear((200, 100, 0), 0))
    assert invisible.metrics(COMPARISON_METRICS) == NO_DIFFERENCE


@pytest.mark.parametrize("alpha", [0, 1, 253])
def test_a_colour_and_an_alpha_rounded_by_one_level_differ_by_one_level(alpha: int) -> None:
    difference = FrameDifference(clear((254, 7, 0), alpha), clear((255, 8, 0), alpha + 1))
    assert difference.largest() == 1.0


def test_an_opaque_alpha_changes_no_metric_of_the_colours() -> None:
    golden, actual = noise((16, 16, 3), 3), noise((16, 16, 3), 4)
    opaque = np.full((16, 16, 1), 255, np.uint8)
    bare = FrameDifference(golden, actual)
    with_alpha = FrameDifference(np.dstack([golden, opaque]), np.dstack([actual, opaque]))
    assert with_alpha.metrics(COMPARISON_METRICS) == bare.metrics(COMPARISON_METRICS)
    assert with_alpha.bias == (*bare.bias, 0.0)


@pytest.mark.parametrize("name", ["flip", "ssim"])
def test_perceptual_metrics_composite_over_the_worse_of_black_and_white(name: str) -> None:
    """Black over black is black at any alpha; only over white another alpha is visible."""
    golden = clear((0, 0, 0), 200)
    actual = golden.copy()
    actual[4:12, 4:12, 3] = 20
    over_white = [np.repeat(255 - picture[..., 3:], 3, axis=2) for picture in (golden, actual)]
    expected = FrameDifference(*over_white).metrics([name])
    assert FrameDifference(golden, actual).metrics([name]) == pytest.approx(expected, rel=1e-6)


# Which metrics.


def test_only_ssim_is_left_out_of_small_pictures() -> None:
    side = SSIM_WINDOW_PX
    for shape, left_out in (((side, side), set()), ((side - 1, side), {"ssim"}), ((1, 1), {"ssim"})):
        figures = FrameDifference(noise((*shape, 3), 7), noise((*shape, 3), 8)).metrics(COMPARISON_METRICS)
        assert set(COMPARISON_METRICS) - set(figures) == left_out
        assert all(math.isfinite(value) for value in figures.values())
