"""The figures of a difference, against closed forms, and the limits by which it passes."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hsplat_cli.compare import PART_PX, Figures, Limit, compare_frame, measure_difference, measure_flip, parse_rules
from renderer.accuracy import MOST_DB, REACH_PX, compute_metric, metric_map
from renderer.errors import SceneError
from renderer.volume import UInt8

GREY = np.full((32, 40, 3), 100, np.uint8)
SAME_BYTES = Limit("same bytes")
STATED = Limit("stated accuracy")


def noise(shape: tuple[int, ...], seed: int = 0) -> UInt8:
    return np.random.default_rng(seed).integers(0, 256, shape, np.uint8)


def clear(color: tuple[int, int, int], alpha: int) -> UInt8:
    return np.broadcast_to(np.array([*color, alpha], np.uint8), (16, 16, 4)).copy()


def decibels(steps: float) -> float:
    """Return the PSNR of a root mean square error in steps of 8 bits."""
    return 20 * math.log10(255 / steps)


def largest(golden: UInt8, actual: UInt8) -> float:
    return measure_difference(golden, actual).largest


@pytest.mark.parametrize("channels", [3, 4])
def test_equal_pictures_differ_by_nothing(channels: int) -> None:
    picture = noise((24, 33, channels))
    figures = measure_difference(picture, picture.copy())
    assert figures == Figures(MOST_DB, MOST_DB, (0, 0), 0.0, is_same=True)


def test_a_constant_shift_has_the_same_psnr_everywhere() -> None:
    figures = measure_difference(GREY, GREY - np.uint8(3))
    assert figures.psnr == pytest.approx(decibels(3), rel=1e-6)
    assert figures.part_psnr == pytest.approx(decibels(3), rel=1e-6)
    assert (figures.largest, figures.is_same) == (pytest.approx(3), False)


def test_one_pixel_counts_by_its_share_of_part_and_picture() -> None:
    actual = GREY.copy()
    actual[20, 30, 1] += 24
    figures = measure_difference(GREY, actual)
    assert figures.psnr == pytest.approx(decibels(24 / math.sqrt(3 * 32 * 40)), rel=1e-6)
    assert figures.part_psnr == pytest.approx(decibels(24 / math.sqrt(3 * PART_PX**2)), rel=1e-6)
    x, y = figures.part
    assert 0 <= 30 - x < PART_PX and 0 <= 20 - y < PART_PX
    assert figures.largest == pytest.approx(24)


@pytest.mark.parametrize("shape", [(20, 31), (8, 8), (8, 30), (1, 1), (3, 5), (3, 20), (9, 8)])
def test_the_worst_part_is_the_worst_of_all(shape: tuple[int, int]) -> None:
    """Parts reach to all borders; a picture that is smaller than a part is one part as high or as wide as it is."""
    golden, actual = noise((*shape, 3), 1), noise((*shape, 3), 2)
    squares = ((actual.astype(float) - golden) ** 2).mean(axis=2)
    height, width = (min(side, PART_PX) for side in shape)
    means = {
        (column, row): squares[row : row + height, column : column + width].mean()
        for row in range(shape[0] - height + 1)
        for column in range(shape[1] - width + 1)
    }
    worst = max(means, key=lambda place: means[place])
    figures = measure_difference(golden, actual)
    assert figures.part == worst
    assert figures.part_psnr == pytest.approx(decibels(math.sqrt(means[worst])), rel=1e-5)


@pytest.mark.parametrize("corner", [(0, 0), (0, -1), (-1, 0), (-1, -1)])
def test_a_corner_is_in_a_part(corner: tuple[int, int]) -> None:
    actual = GREY.copy()
    actual[corner] += 50
    assert measure_difference(GREY, actual).part_psnr == pytest.approx(decibels(50 / PART_PX), rel=1e-6)


# Alpha


def test_colours_are_weighted_by_the_larger_alpha() -> None:
    assert largest(clear((50, 0, 0), 51), clear((60, 0, 0), 51)) == pytest.approx(2)
    thin, dense = clear((100, 0, 0), 50), clear((200, 0, 0), 51)
    assert largest(thin, dense) == largest(dense, thin) == pytest.approx(20)
    assert largest(clear((0, 0, 0), 100), clear((0, 0, 0), 130)) == pytest.approx(30)  # alpha alone


def test_invisible_colours_differ_in_stored_values_alone() -> None:
    golden, actual = clear((1, 2, 3), 0), clear((200, 100, 0), 0)
    assert measure_difference(golden, actual) == Figures(MOST_DB, MOST_DB, (0, 0), 0.0, is_same=False)
    assert compare_frame("a", golden, actual, SAME_BYTES).status == "different"
    assert compare_frame("a", golden, actual, Limit("decibels", MOST_DB)).status == "close"


@pytest.mark.parametrize("alpha", [0, 1, 253])
def test_a_colour_and_an_alpha_rounded_by_one_step_differ_by_one_step(alpha: int) -> None:
    assert largest(clear((254, 7, 0), alpha), clear((255, 8, 0), alpha + 1)) == pytest.approx(1)


def test_an_opaque_alpha_dilutes_the_error_of_colours_and_moves_no_part() -> None:
    golden, actual = noise((16, 16, 3), 3), noise((16, 16, 3), 4)
    opaque = np.full((16, 16, 1), 255, np.uint8)
    bare = measure_difference(golden, actual)
    beside = measure_difference(np.dstack([golden, opaque]), np.dstack([actual, opaque]))
    assert (beside.part, beside.largest) == (bare.part, bare.largest)
    assert beside.psnr - bare.psnr == pytest.approx(10 * math.log10(4 / 3), rel=1e-6)


# FLIP


@pytest.mark.parametrize("share", [1.0, 0.0])
def test_flip_of_squares_adds_up(share: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsplat_cli.compare.difference._BLOCK_PX", 32)
    golden, other = noise((65, 100, 3)), noise((65, 100, 3), 1)
    spoiled = np.random.default_rng(2).random((65, 100)) < share
    spoiled[31, 63] = spoiled[64, 0] = True  # at corners of squares, the second in one of a single row
    actual = np.where(spoiled[..., None], other, golden)
    assert measure_flip(golden, actual) == pytest.approx(compute_metric("flip", actual / 255, golden / 255), abs=1e-12)


def test_a_pixel_changes_flip_within_its_reach_only() -> None:
    golden = noise((64, 64, 3)) / 255
    actual = golden.copy()
    actual[30, 33] = 1 - actual[30, 33].round()
    rows, columns = np.nonzero(np.abs(metric_map("flip", actual, golden)) > 1e-12)
    reach = max(30 - rows.min(), rows.max() - 30, 33 - columns.min(), columns.max() - 33)
    assert 0 < reach <= REACH_PX


def test_flip_composites_over_the_worse_of_black_and_white() -> None:
    """Black over black is black at any alpha; only over white another alpha is visible."""
    golden = clear((0, 0, 0), 200)
    actual = golden.copy()
    actual[4:12, 4:12, 3] = 20
    over_white = [np.repeat(255 - picture[..., 3:], 3, axis=2) for picture in (golden, actual)]
    assert measure_flip(golden, actual) == pytest.approx(measure_flip(*over_white), rel=1e-6)


# Limits


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        ("same bytes", SAME_BYTES),
        (" Stated Accuracy ", STATED),
        ("45", Limit("decibels", 45)),
        ("45.125 dB", Limit("decibels", 45.125)),
        ("200DB", Limit("decibels", 200)),
    ],
)
def test_limits_are_spelled_in_three_ways(text: str, limit: Limit) -> None:
    assert parse_rules(None, text).limit == limit
    assert parse_rules(None, str(limit)).limit == limit


@pytest.mark.parametrize("text", ["", "exact", "0", "-45", "1e2", "200.1", "nan", "45 dBm", "٤٥", "45\n\n45"])
def test_other_limits_are_refused(text: str) -> None:
    with pytest.raises(SceneError, match=r"not a limit|out of range"):
        parse_rules(None, text)


def figures(psnr: float, part_psnr: float) -> Figures:
    return Figures(psnr, part_psnr, (0, 0), 9.0, is_same=False)


def test_decibels_are_those_of_the_worst_part() -> None:
    limit = Limit("decibels", 40)
    assert limit.passes(figures(60, 40))
    assert not limit.passes(figures(60, 39.99))
    assert not SAME_BYTES.passes(figures(MOST_DB, MOST_DB), (1, 1))


def test_the_stated_accuracies_add_up_as_errors() -> None:
    """Two errors of 8 and 4 steps allow a difference of 12; a part may differ more than the picture."""
    stated = decibels(8), decibels(4)
    assert STATED.least_psnr(stated) == pytest.approx(decibels(12))
    assert STATED.passes(figures(decibels(11.99), 0.1), stated)
    assert not STATED.passes(figures(decibels(12.01), MOST_DB), stated)
    for stated in ((None, 60.0), (60.0, None), (None, None)):
        assert not STATED.passes(figures(MOST_DB - 1, MOST_DB - 1), stated), "a picture states no accuracy"


def test_a_new_picture_counts_as_no_less_accurate_than_its_golden() -> None:
    """A fault of drawing gives an error of 30 steps, which exact rays see and the new picture states."""
    stated = decibels(4), decibels(30)
    assert STATED.least_psnr(stated) == pytest.approx(decibels(8))
    assert not STATED.passes(figures(decibels(30), 0.1), stated)


# Frames


def test_pictures_of_other_shapes_are_not_measured() -> None:
    statuses = {
        "missing": (GREY, None),
        "new": (None, GREY),
        "other size": (GREY, GREY[1:]),
        "other channels": (GREY, np.dstack([GREY, GREY[..., 0]])),
        "same": (GREY, GREY.copy()),
    }
    for status, pictures in statuses.items():
        frame = compare_frame("a", *pictures, Limit("decibels", 1))
        assert (frame.status, frame.passes) == (status, status == "same")
    assert compare_frame("a", GREY, GREY[1:], SAME_BYTES).why == "40 x 31 pixels, the golden has 40 x 32"


def test_a_frame_says_how_it_differs_and_what_was_wanted() -> None:
    actual = GREY.copy()
    actual[:, 8:16] += 3
    close = compare_frame("a", GREY, actual, Limit("decibels", 38))
    assert close.status == "close"
    assert close.why == (
        "45.6 dB, 38.6 dB in 8 x 8 pixels at 8, 0, largest error 3 steps of 255; no part of 8 x 8 pixels below 38 dB"
    )
    different = compare_frame("a", GREY, actual, STATED, (50.0, 60.0))
    assert different.status == "different"
    assert different.why.endswith("; wanted: no more difference than the stated accuracies allow (47.6 dB)")
    assert different.flip is not None and different.flip > 0
    assert compare_frame("a", GREY, actual, STATED).why.endswith(", but they do not state theirs")
