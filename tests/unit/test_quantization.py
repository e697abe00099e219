"""Quantisation is exact where arithmetic is exact, rounds half up, and refuses NaN."""

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, strategies as st

from renderer.errors import RenderError
from renderer.film import quantize

BLACK, WHITE, ORANGE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1.0, 0.5, 0.25)


def pixel(*rgba: float) -> npt.NDArray[np.float32]:
    return np.array([[rgba]], np.float32)


def test_every_level_survives() -> None:
    levels = np.arange(256, dtype=np.float32) / 255
    image = np.stack([levels, levels, levels, np.ones_like(levels)], axis=1)[None]
    for background in (BLACK, None):
        np.testing.assert_array_equal(quantize(image, background)[0, :, 0], np.arange(256))


def test_halves_go_up() -> None:
    # 0.5 * 255 = 127.5 exactly, and it is exact in float32.
    assert quantize(pixel(0.5, 0, 0, 1), BLACK).tolist() == [[[128, 0, 0]]]
    assert quantize(pixel(0, 0, 0, 0.5), None).tolist() == [[[0, 0, 0, 128]]]


def test_clips_instead_of_wrapping() -> None:
    assert quantize(pixel(1.5, -0.5, 300, 1), BLACK).tolist() == [[[255, 0, 255]]]
    assert quantize(pixel(1.5, -0.5, 300, 1.01), None).tolist() == [[[255, 0, 255, 255]]]
    assert quantize(pixel(0, 0, 0, -0.1), None).tolist() == [[[0, 0, 0, 0]]]


def test_an_empty_image_is_the_background() -> None:
    assert quantize(np.zeros((2, 3, 4), np.float32), ORANGE).tolist() == [[[255, 128, 64]] * 3] * 2
    assert not quantize(np.zeros((2, 3, 4), np.float32), None).any()


@given(
    color=st.tuples(*[st.floats(0, 1, width=32)] * 3),
    alpha=st.floats(0, 1, width=32),
    background=st.tuples(*[st.floats(0, 1, width=32)] * 3),
)
def test_over_is_within_rounding_of_the_formula(
    color: tuple[float, float, float], alpha: float, background: tuple[float, float, float]
) -> None:
    premultiplied = [c * alpha for c in color]
    exact = [255 * (c + (1 - alpha) * b) for c, b in zip(premultiplied, background, strict=True)]
    result = quantize(pixel(*premultiplied, alpha), background)[0, 0]
    # Half a level of rounding, and 1e-4 for five float32 operations on values up to 255 (ulp 1.5e-5).
    np.testing.assert_allclose(result, exact, rtol=0, atol=0.5 + 1e-4)


@given(color=st.tuples(*[st.floats(0, 1, width=32)] * 3), alpha=st.floats(0, 1, width=32))
def test_straight_alpha_gives_the_colour_back(color: tuple[float, float, float], alpha: float) -> None:
    *straight, opacity = quantize(pixel(*(c * alpha for c in color), alpha), None)[0, 0].tolist()
    assert opacity == pytest.approx(255 * alpha, abs=0.5 + 1e-4)
    # Rounding as above; relative to alpha the premultiplied float32 loses nothing more than its own ulp.
    expected = [255 * c for c in color] if opacity else [0, 0, 0]
    np.testing.assert_allclose(straight, expected, rtol=0, atol=0.5 + 1e-4)


def test_what_is_fully_transparent_has_no_colour() -> None:
    # Alpha below half a level is written as 0; a colour left there would show as a fringe in some viewers.
    assert quantize(pixel(0.001, 0.0005, 0, 0.001), None).tolist() == [[[0, 0, 0, 0]]]


@pytest.mark.parametrize("background", [BLACK, None])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("channel", range(4))
def test_a_value_that_is_no_number_fails(
    background: tuple[float, float, float] | None, value: float, channel: int
) -> None:
    image = np.zeros((4, 5, 4), np.float32)
    image[2, 3, channel] = value
    with pytest.raises(RenderError, match="1 of 20 pixels, the first at row 2, column 3"):
        quantize(image, background)


def test_input_is_left_alone() -> None:
    image = np.random.default_rng(0).random((8, 8, 4), dtype=np.float32)
    image.flags.writeable = False
    before = image.copy()
    quantize(image, WHITE)
    quantize(image, None)
    np.testing.assert_array_equal(image, before)
