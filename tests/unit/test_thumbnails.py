"""Tests of small pictures, and of pictures of differences."""

from __future__ import annotations

import numpy as np
import pytest

from hsplat_cli.measure import DIFFERENCE_GAIN, THUMBNAIL_PX, amplified_difference, thumbnail
from renderer.film import rounded


@pytest.mark.parametrize(
    ("size", "small"), [((1, 1), (1, 1)), ((256, 256), (256, 256)), ((257, 3), (129, 2)), ((5, 769), (2, 193))]
)
def test_thumbnails_are_small_and_keep_even_pictures(size: tuple[int, int], small: tuple[int, int]) -> None:
    made = thumbnail(np.full((*size, 3), 0.4))
    assert made.shape == (*small, 3) and max(small) <= THUMBNAIL_PX
    assert np.all(made == 102)


def test_blocks_are_means() -> None:
    checkered = np.indices((512, 512)).sum(axis=0) % 2
    made = thumbnail(np.repeat(checkered[..., None], 3, axis=2).astype(float))
    assert np.all(made == 128)  # 127.5, rounded half up as in every picture


def test_differences_are_amplified_and_have_no_sign() -> None:
    truth = np.full((4, 4, 3), 0.5)
    picture = truth + np.array([0.05, -0.05, 0.4])
    amplified = [round(0.05 * DIFFERENCE_GAIN * 255)] * 2 + [255]
    assert np.all(rounded(amplified_difference(picture, truth)) == amplified)
