"""Tests of the metrics against closed forms and published values, with their masks, pools and errors."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Mapping

import numpy as np
import pytest

from renderer.accuracy import METRICS, compute_metric, measure_accuracy, pool_accuracies, require_measuring_packages
from renderer.errors import InputError, RenderError
from renderer.film import over_background
from renderer.volume import Float64

# Sums of some thousand float64.
EXACT = 1e-12


def grey(value: float, height: int = 24, width: int = 32) -> Float64:
    return np.full((height, width, 3), value)


def noisy(seed: int, height: int = 24, width: int = 32) -> Float64:
    return np.random.default_rng(seed).random((height, width, 3))


def everywhere(picture: Float64, truth: Float64) -> Mapping[str, float]:
    return measure_accuracy(picture, truth, np.ones(picture.shape[:2], bool)).everywhere


def test_equal_pictures() -> None:
    found = everywhere(noisy(1), noisy(1))
    assert list(found) == list(METRICS)
    assert list(found.values()) == [0.0, 0.0, math.inf, 1.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize("offset", [0.1, -0.1, 0.003])
def test_a_constant_offset(offset: float) -> None:
    found = everywhere(grey(0.5 + offset), grey(0.5))
    assert found["rmse"] == pytest.approx(abs(offset), abs=EXACT)
    assert found["max_error"] == pytest.approx(abs(offset), abs=EXACT)
    assert found["psnr"] == pytest.approx(-20 * math.log10(abs(offset)), abs=1e-9)
    # Without variance only the term of the means is left (Wang et al. 2004, equation 6, K1 = 0.01).
    a, b = 0.5 + offset, 0.5
    assert found["ssim"] == pytest.approx((2 * a * b + 1e-4) / (a * a + b * b + 1e-4), abs=EXACT)


def test_one_pixel_of_many() -> None:
    picture = grey(0.5)
    picture[7, 9, 1] = 0.9
    found = everywhere(picture, grey(0.5))
    assert found["rmse"] == pytest.approx(0.4 / math.sqrt(picture.size), abs=EXACT)
    assert found["max_error"] == pytest.approx(0.4, abs=EXACT)
    assert found["delta_e_share"] == 1 / (24 * 32)


def luminance_of(lightness: float) -> float:
    """CIE 1976: relative luminance, for lightnesses over 8."""
    return ((lightness + 16) / 116) ** 3


def srgb(linear: float) -> float:
    """IEC 61966-2-1, for values over 0.0031308."""
    return 1.055 * linear ** (1 / 2.4) - 0.055


@pytest.mark.parametrize(("difference", "share"), [(2.25, 0.0), (2.35, 1.0)])
def test_the_just_noticeable_difference(difference: float, share: float) -> None:
    """Greys differ in lightness alone, so that their colour difference is that of L*."""
    picture, truth = (grey(srgb(luminance_of(lightness))) for lightness in (50 + difference, 50))
    assert compute_metric("delta_e_share", picture, truth) == share


def test_flip_of_black_and_white_and_of_green_and_blue() -> None:
    """Opposite colours are as far apart as can be; black and white a little less, by the metric's definition of its
    largest difference as that of green and blue (Andersson et al. 2020, section 3.1.3)."""
    green, blue = grey(0.0), grey(0.0)
    green[..., 1] = blue[..., 2] = 1.0
    assert compute_metric("flip", green, blue) == pytest.approx(1.0, abs=1e-6)  # float32 inside
    assert compute_metric("flip", grey(0.0), grey(1.0)) == pytest.approx(0.967, abs=5e-4)
    assert compute_metric("flip_p99", grey(0.0), grey(1.0)) == pytest.approx(0.967, abs=5e-4)


def test_flip_takes_its_pictures_as_srgb() -> None:
    """Half of white, as a display value, is nearer to black for the eye than half of the light would be."""
    assert compute_metric("flip", grey(0.5), grey(0.0)) < compute_metric("flip", grey(srgb(0.5)), grey(0.0))


@pytest.mark.parametrize("name", list(METRICS))
def test_more_noise_is_never_better(name: str) -> None:
    truth, noise = noisy(1) * 0.5 + 0.25, noisy(2) - 0.5
    figures = [compute_metric(name, truth + amount * noise, truth) for amount in (0.01, 0.05, 0.4)]
    better = METRICS[name].higher_is_better
    assert figures == sorted(figures, reverse=better)


def test_noise_far_from_the_mask_changes_nothing_on_it() -> None:
    """Far: beyond the reach of SSIM's window (5 pixels) and of FLIP's filters (about 10)."""
    truth = noisy(1, 40, 40)
    picture = np.clip(truth + 0.02, 0, 1)
    mask = np.zeros((40, 40), bool)
    mask[:12] = True
    disturbed = picture.copy()
    disturbed[30:] = noisy(3, 10, 40)
    calm, rough = measure_accuracy(picture, truth, mask), measure_accuracy(disturbed, truth, mask)
    assert rough.on_volume == calm.on_volume
    assert rough.everywhere["psnr"] < calm.everywhere["psnr"]
    assert rough.everywhere["ssim"] < calm.everywhere["ssim"]
    assert rough.everywhere["flip"] > calm.everywhere["flip"]


@pytest.mark.parametrize("size", [(1, 1), (5, 300), (300, 10)])
def test_pictures_smaller_than_the_window_have_no_ssim(size: tuple[int, int]) -> None:
    found = everywhere(noisy(1, *size), noisy(2, *size))
    assert math.isnan(found["ssim"])
    assert -1 < compute_metric("ssim", noisy(1, 11, 11), noisy(2, 11, 11)) < 1
    assert all(math.isfinite(value) for name, value in found.items() if name != "ssim")


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_a_value_that_is_not_finite_is_an_error(wrong: float) -> None:
    bad = grey(0.5)
    bad[3, 4, 0] = wrong
    for pair in ((bad, grey(0.5)), (grey(0.5), bad)):
        with pytest.raises(RenderError, match="1 of 768 pixels, the first at row 3, column 4"):
            measure_accuracy(*pair, np.ones((24, 32), bool))
        with pytest.raises(RenderError, match="row 3, column 4"):
            compute_metric("flip", *pair)
    radiance = np.zeros((2, 3, 4), np.float32)
    radiance[1, 2, 3] = wrong
    with pytest.raises(RenderError, match="row 1, column 2"):
        over_background(radiance, None)


def test_pictures_are_not_changed() -> None:
    """Even if they are read-only or not contiguous."""
    one, other = noisy(1, 48, 64)[::2, ::2], noisy(2, 48, 64)[::2, ::2]
    before = one.copy(), other.copy()
    one.flags.writeable = other.flags.writeable = False
    found = everywhere(one, other)
    assert np.array_equal(one, before[0]) and np.array_equal(other, before[1])
    assert found == everywhere(*before)


def test_premultiplied_over_a_background() -> None:
    radiance = np.array([[[0.2, 0.0, 0.1, 0.5], [0.0, 0.0, 0.0, 0.0], [1.5, 1.0, 0.0, 1.0]]], np.float32)
    over = over_background(radiance, (1.0, 0.5, 0.0))
    assert over.dtype == np.float64
    # float32 inputs
    assert over[0] == pytest.approx(np.array([[0.7, 0.25, 0.1], [1.0, 0.5, 0.0], [1.0, 1.0, 0.0]]), abs=1e-7)
    assert np.array_equal(over_background(radiance, None), over_background(radiance, (0.0, 0.0, 0.0)))


def test_frames_pool_their_squares() -> None:
    pictures, truths = [grey(0.6), grey(0.7), noisy(3)], [grey(0.5), grey(0.5), noisy(4)]
    mask = np.ones((24, 32), bool)
    each = [measure_accuracy(picture, truth, mask) for picture, truth in zip(pictures, truths, strict=True)]
    side_by_side = everywhere(np.concatenate(pictures, 1), np.concatenate(truths, 1))
    found = pool_accuracies(each).everywhere
    for name in ("rmse", "max_error", "psnr", "delta_e_share"):
        assert found[name] == pytest.approx(side_by_side[name], abs=1e-9)
    for name in ("ssim", "flip", "flip_p99"):
        assert found[name] == pytest.approx(np.mean([one.everywhere[name] for one in each]), abs=EXACT)
    assert pool_accuracies(each).on_volume == found
    assert pool_accuracies(each[:1]) == each[0]
    equal = measure_accuracy(noisy(1), noisy(1), mask)
    assert pool_accuracies([equal] * 2) == equal


def test_an_empty_mask_has_no_metrics_and_is_left_out_of_the_pool() -> None:
    seen = measure_accuracy(noisy(1), noisy(2), np.ones((24, 32), bool))
    empty = measure_accuracy(noisy(3), noisy(4), np.zeros((24, 32), bool))
    assert not any(math.isnan(value) for value in empty.everywhere.values())
    assert pool_accuracies([seen, empty]).on_volume == seen.on_volume
    for found in (empty, pool_accuracies([empty, empty])):
        assert all(math.isnan(value) for value in found.on_volume.values())


@pytest.mark.parametrize("package", ["skimage", "flip_evaluator"])
def test_a_missing_package_is_reported(package: str, monkeypatch: pytest.MonkeyPatch) -> None:
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == package else find_spec(name))
    with pytest.raises(InputError) as caught:
        require_measuring_packages()
    assert str(caught.value) == f"the package {package} is not installed\n  hint: pip install 'hsplat[measure]'"
