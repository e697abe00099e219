"""Quantisation is exact where arithmetic is exact, rounds half up, and refuses NaN."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

from renderer.errors import RenderError
from renderer.film import quantize
from renderer.transfer import linear_of_srgb
from renderer.volume import Float32

Color = tuple[float, float, float]
PART = st.floats(0, 1, width=32)
COLOR = st.tuples(PART, PART, PART)
BLACK, WHITE, ORANGE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1.0, 0.5, 0.25)


def pixel(*rgba: float) -> Float32:
    return np.array([[rgba]], np.float32)


def test_every_level_survives() -> None:
    levels = np.arange(256, dtype=np.float32) / 255
    image = np.stack([levels, levels, levels, np.ones_like(levels)], axis=1)[None]
    for background in (BLACK, None):
        np.testing.assert_array_equal(quantize(image, background)[0, :, 0], np.arange(256))


@pytest.mark.parametrize("depth", [8, 16])
def test_every_level_survives_in_linear_light(depth: int) -> None:
    largest = 2**depth - 1
    levels = np.arange(0, largest + 1, 1 if depth == 8 else 255)
    linear = linear_of_srgb(levels / largest).astype(np.float32)
    for alpha in (1.0, 0.5):
        image = np.stack([alpha * linear] * 3 + [np.full_like(linear, alpha)], axis=1)[None]
        np.testing.assert_array_equal(quantize(image, None, depth, is_linear=True)[0, :, 1], levels)
        # The same colour behind the picture leaves it as it is.
        for level in (0, len(levels) // 2, len(levels) - 1):
            behind = (float(levels[level] / largest),) * 3
            over = quantize(np.ascontiguousarray(image[:, level : level + 1]), behind, depth, is_linear=True)
            np.testing.assert_array_equal(over[0, 0], [levels[level]] * 3)


def test_linear_light_is_clipped_and_floats_keep_it() -> None:
    image = pixel(2.0, -1.0, 0.214042, 1.0)
    np.testing.assert_array_equal(quantize(image, BLACK, is_linear=True)[0, 0], [255, 0, 128])
    np.testing.assert_array_equal(quantize(image, BLACK, 16, is_linear=True)[0, 0], [65535, 0, 32768])
    np.testing.assert_array_equal(quantize(image, BLACK, 32, is_linear=True), image[..., :3])
    half = quantize(pixel(0.0, 0.0, 0.0, 0.5), WHITE, 32, is_linear=True)
    np.testing.assert_array_equal(half[0, 0], [0.5] * 3)


@pytest.mark.parametrize(
    ("rgba", "background", "expected"),
    [
        ((0.5, 0, 0, 1), BLACK, [128, 0, 0]),  # halves go up: 0.5 * 255 = 127.5 exactly, in float32, too
        ((0, 0, 0, 0.5), None, [0, 0, 0, 128]),
        ((1.5, -0.5, 300, 1), BLACK, [255, 0, 255]),  # clipped, not wrapped
        ((1.5, -0.5, 300, 1.01), None, [255, 0, 255, 255]),
        ((0, 0, 0, -0.1), None, [0, 0, 0, 0]),
        ((0, 0, 0, 0), ORANGE, [255, 128, 64]),
        ((0.001, 0.0005, 0, 0.001), None, [0, 0, 0, 0]),  # else some viewers would show a fringe
    ],
)
def test_one_pixel(rgba: tuple[float, ...], background: Color | None, expected: list[int]) -> None:
    assert quantize(pixel(*rgba), background).tolist() == [[expected]]


@given(color=COLOR, alpha=PART, background=COLOR)
def test_over_is_within_rounding_of_the_formula(color: Color, alpha: float, background: Color) -> None:
    premultiplied = [c * alpha for c in color]
    exact = [255 * (c + (1 - alpha) * b) for c, b in zip(premultiplied, background, strict=True)]
    result = quantize(pixel(*premultiplied, alpha), background)[0, 0]
    # Half a level of rounding, and 1e-4 for five float32 operations on values up to 255 (ulp 1.5e-5).
    np.testing.assert_allclose(result, exact, rtol=0, atol=0.5 + 1e-4)


@given(color=COLOR, alpha=PART)
def test_straight_alpha_gives_the_colour_back(color: Color, alpha: float) -> None:
    *straight, opacity = quantize(pixel(*(c * alpha for c in color), alpha), None)[0, 0].tolist()
    assert opacity == pytest.approx(255 * alpha, abs=0.5 + 1e-4)
    # Rounding as above; relative to alpha the premultiplied float32 loses nothing more than its own ulp.
    expected = [255 * c for c in color] if opacity else [0, 0, 0]
    np.testing.assert_allclose(straight, expected, rtol=0, atol=0.5 + 1e-4)


@pytest.mark.parametrize("background", [BLACK, None])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("channel", range(4))
def test_a_value_that_is_no_number_fails(background: Color | None, value: float, channel: int) -> None:
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
