"""Figures of pictures whose difference is known in closed form."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import pytest

from renderer.study import COMPARISON_METRICS, SSIM_WINDOW_PX, FrameDifference, comparison, compute_metric
from renderer.study.comparison import WINDOW_PX
from renderer.study.metrics import REACH_PX, metric_map

Pixels = npt.NDArray[np.uint8]

GREY = np.full((32, 40, 3), 100, np.uint8)
LEVELS = ("largest", "p99", "densest", "bias")


def noise(shape: tuple[int, ...], seed: int = 0) -> Pixels:
    return np.random.default_rng(seed).integers(0, 256, shape, np.uint8)


def clear(color: tuple[int, int, int], alpha: int) -> Pixels:
    return np.broadcast_to(np.array([*color, alpha], np.uint8), (16, 16, 4)).copy()


@pytest.mark.parametrize("channels", [3, 4])
def test_equal_pictures_differ_by_nothing(channels: int) -> None:
    picture = noise((24, 33, channels))
    difference = FrameDifference(picture, picture.copy())
    expected = {"largest": 0, "p99": 0, "flip": 0, "ssim": 1, "densest": 0, "bias": 0}
    assert difference.metrics(COMPARISON_METRICS) == pytest.approx(expected, abs=1e-12)
    assert difference.bias == (0.0,) * channels
    assert not difference.levels.any()
    assert not difference.signed.any()


def test_a_constant_shift_is_every_figure_in_levels() -> None:
    difference = FrameDifference(GREY, GREY - np.array([0, 3, 0], np.uint8))
    assert difference.metrics(LEVELS) == {"largest": 3.0, "p99": 3.0, "densest": 3.0, "bias": 3.0}
    assert difference.bias == (0.0, -3.0, 0.0)
    assert (difference.levels == 3).all()
    assert (difference.signed_levels == -3).all()
    assert (difference.signed == (0, -3, 0)).all()


def test_levels_are_subtracted_as_numbers_and_not_modulo_256() -> None:
    black, white = np.zeros((9, 9, 3), np.uint8), np.full((9, 9, 3), 255, np.uint8)
    assert FrameDifference(black, white).bias == (255.0,) * 3
    assert FrameDifference(white, black).bias == (-255.0,) * 3


@pytest.mark.parametrize("name", ["flip", "ssim"])
@pytest.mark.parametrize("share", [1.0, 0.0])
def test_square_by_square_is_as_the_whole_picture(name: str, share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(comparison, "_BLOCK_PX", 32)
    golden, other = noise((65, 100, 3)), noise((65, 100, 3), 1)
    spoiled = np.random.default_rng(2).random((65, 100)) < share
    spoiled[31, 63] = spoiled[64, 0] = True  # at corners of squares, the second in one of a single row
    actual = np.where(spoiled[..., None], other, golden)
    expected = compute_metric(name, actual / 255, golden / 255)
    assert FrameDifference(golden, actual).perceptual_metric(name) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("name", ["flip", "ssim"])
def test_a_pixel_changes_what_is_seen_within_reach_only(name: str) -> None:
    golden = noise((64, 64, 3)) / 255
    actual = golden.copy()
    actual[30, 33] = 1 - actual[30, 33].round()
    perfect = float(COMPARISON_METRICS[name].higher_is_better)
    rows, columns = np.nonzero(np.abs(metric_map(name, actual, golden) - perfect) > 1e-12)
    reach = max(30 - rows.min(), rows.max() - 30, 33 - columns.min(), columns.max() - 33)
    assert 0 < reach <= REACH_PX


def test_one_pixel_is_its_share_of_window_and_picture() -> None:
    actual = GREY.copy()
    actual[5, 7] += np.array([6, 0, 12], np.uint8)
    figures = FrameDifference(GREY, actual).metrics(LEVELS)
    assert figures == {"largest": 12.0, "p99": 0.0, "densest": 12 / 64, "bias": 12 / (32 * 40)}


def test_a_cluster_is_dense_where_the_same_noise_scattered_is_not() -> None:
    scattered, cluster = GREY.copy(), GREY.copy()
    scattered[::8, ::8] += 1
    cluster[3:7, 9:14] += 1
    assert np.count_nonzero(scattered - GREY) == np.count_nonzero(cluster - GREY) == 60
    dense, thin = FrameDifference(GREY, cluster), FrameDifference(GREY, scattered)
    assert (dense.largest(), dense.bias) == (thin.largest(), thin.bias)
    assert dense.densest() == 20 / 64
    assert thin.densest() == 1 / 64


@pytest.mark.parametrize("shape", [(20, 31), (8, 8), (8, 30), (30, 9)])
def test_the_densest_window_is_the_worst_of_all_windows(shape: tuple[int, int]) -> None:
    golden, actual = noise((*shape, 3), 1), noise((*shape, 3), 2)
    errors = np.abs(actual.astype(float) - golden)
    means = [
        errors[row : row + WINDOW_PX, column : column + WINDOW_PX].mean(axis=(0, 1)).max()
        for row in range(shape[0] - WINDOW_PX + 1)
        for column in range(shape[1] - WINDOW_PX + 1)
    ]
    assert FrameDifference(golden, actual).densest() == pytest.approx(max(means), rel=1e-12)


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (3, 20)])
def test_in_a_picture_smaller_than_the_window_it_is_what_fits(shape: tuple[int, int]) -> None:
    golden = np.zeros((*shape, 3), np.uint8)
    actual = golden.copy()
    actual[0, 0] = 30
    assert FrameDifference(golden, actual).densest() == 30 / (min(shape[0], 8) * min(shape[1], 8))


def test_the_99th_percentile_leaves_the_worst_hundredth_out() -> None:
    golden = np.zeros((10, 101, 3), np.uint8)
    actual = golden.copy()
    actual[:, 0] = 200
    assert FrameDifference(golden, actual).p99() == 0
    actual[0, 1] = actual[0, 2] = 40  # 12 pixels of 1010
    assert FrameDifference(golden, actual).p99() == 40


def test_bias_takes_the_most_shifted_channel_and_errors_cancel() -> None:
    actual = GREY.astype(int)
    actual[::2, :, 0] += 4
    actual[1::2, :, 0] -= 4
    actual[..., 2] -= 1
    difference = FrameDifference(GREY, actual.astype(np.uint8))
    assert difference.bias == (0.0, 0.0, -1.0)
    assert difference.metrics(["bias"]) == {"bias": 1.0}


# Alpha.


def test_a_color_counts_as_much_as_it_is_opaque() -> None:
    difference = FrameDifference(clear((50, 0, 0), 51), clear((60, 0, 0), 51))
    assert difference.metrics(LEVELS) == {"largest": 2.0, "p99": 2.0, "densest": 2.0, "bias": 2.0}


def test_as_much_as_in_the_picture_in_which_it_is_more_so() -> None:
    thin, dense = clear((100, 0, 0), 50), clear((200, 0, 0), 51)
    assert FrameDifference(thin, dense).bias == (20.0, 0.0, 0.0, 1.0)
    assert FrameDifference(dense, thin).bias == (-20.0, 0.0, 0.0, -1.0)


def test_what_cannot_be_seen_does_not_count() -> None:
    assert FrameDifference(clear((1, 2, 3), 0), clear((200, 100, 0), 0)).metrics(COMPARISON_METRICS) == pytest.approx(
        {"largest": 0, "p99": 0, "flip": 0, "ssim": 1, "densest": 0, "bias": 0}, abs=1e-12
    )


@pytest.mark.parametrize("alpha", [0, 1, 100, 253])
def test_a_color_and_an_alpha_that_are_rounded_otherwise_are_off_by_one_level(alpha: int) -> None:
    difference = FrameDifference(clear((254, 7, 0), alpha), clear((255, 8, 0), alpha + 1))
    assert difference.largest() == 1.0


def test_alpha_is_a_channel_of_its_own() -> None:
    difference = FrameDifference(clear((0, 0, 0), 100), clear((0, 0, 0), 130))
    assert difference.bias == (0.0, 0.0, 0.0, 30.0)
    assert difference.densest() == 30


def test_an_opaque_alpha_changes_no_figure_of_the_colors() -> None:
    golden, actual = noise((16, 16, 3), 3), noise((16, 16, 3), 4)
    opaque = np.full((16, 16, 1), 255, np.uint8)
    bare = FrameDifference(golden, actual)
    with_alpha = FrameDifference(np.dstack([golden, opaque]), np.dstack([actual, opaque]))
    assert with_alpha.metrics(COMPARISON_METRICS) == bare.metrics(COMPARISON_METRICS)
    assert with_alpha.bias == (*bare.bias, 0.0)


@pytest.mark.parametrize("name", ["flip", "ssim"])
def test_metrics_of_the_eye_look_at_transparent_pictures_over_the_worse_of_black_and_white(name: str) -> None:
    """Black over black, at any alpha, is black: only over white it can be seen that the alpha is another."""
    golden = clear((0, 0, 0), 200)
    actual = golden.copy()
    actual[4:12, 4:12, 3] = 20
    over_white = [np.repeat(255 - picture[..., 3:], 3, axis=2) for picture in (golden, actual)]
    expected = FrameDifference(*over_white).metrics([name])
    assert FrameDifference(golden, actual).metrics([name]) == pytest.approx(expected, rel=1e-6)


# Which figures.


def test_figures_come_in_their_order_whatever_is_asked_for_first() -> None:
    difference = FrameDifference(noise((16, 16, 3), 5), noise((16, 16, 3), 6))
    assert list(difference.metrics(reversed(COMPARISON_METRICS))) == list(COMPARISON_METRICS)
    assert list(difference.metrics(["bias", "largest"])) == ["largest", "bias"]
    assert difference.metrics([]) == {}


def test_all_have_a_number_but_ssim_in_a_picture_smaller_than_its_window() -> None:
    side = SSIM_WINDOW_PX
    for shape, left_out in (((side, side), set()), ((side - 1, side), {"ssim"}), ((1, 1), {"ssim"})):
        figures = FrameDifference(noise((*shape, 3), 7), noise((*shape, 3), 8)).metrics(COMPARISON_METRICS)
        assert set(COMPARISON_METRICS) - set(figures) == left_out
        assert all(math.isfinite(value) for value in figures.values())


def test_both_directions_are_equally_far() -> None:
    golden, actual = noise((20, 20, 4), 9), noise((20, 20, 4), 10)
    there, back = FrameDifference(golden, actual), FrameDifference(actual, golden)
    assert there.metrics(LEVELS) == back.metrics(LEVELS)
    assert there.bias == tuple(-value for value in back.bias)


def test_pictures_are_not_changed() -> None:
    golden, actual = noise((12, 12, 4), 11), noise((12, 12, 4), 12)
    before = golden.copy(), actual.copy()
    FrameDifference(golden, actual).metrics(COMPARISON_METRICS)
    assert (golden == before[0]).all()
    assert (actual == before[1]).all()


def test_a_limit_is_the_last_value_that_passes() -> None:
    assert COMPARISON_METRICS["largest"].passes(4.0, 4.0)
    assert not COMPARISON_METRICS["largest"].passes(math.nextafter(4.0, 5.0), 4.0)
    assert COMPARISON_METRICS["ssim"].passes(0.98, 0.98)
    assert not COMPARISON_METRICS["ssim"].passes(math.nextafter(0.98, 0.0), 0.98)
    assert not COMPARISON_METRICS["largest"].passes(math.nan, 4.0)
    assert not COMPARISON_METRICS["ssim"].passes(math.nan, 0.98)
