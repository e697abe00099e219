"""Tests of the tolerances that are worth trying."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from renderer.accuracy import (
    distinct_tolerances,
    spread_tolerances,
    tolerance_ladder,
)
from renderer.pyramid import Pyramid, build_pyramid, cut_pyramid, root_error
from renderer.scene import ControlPoint, ErrorSpec, PyramidSpec, TransferSpec
from renderer.transfer import make_transfer_function
from renderer.volume import make_volume


@pytest.fixture(scope="module")
def pyramid() -> Pyramid:
    values = np.random.default_rng(3).integers(0, 256, (24, 32, 40), dtype=np.uint8)
    values[:, :, :20] //= 8  # half of it nearly even, so that errors differ
    return _pyramid(values)


def _pyramid(values: np.ndarray) -> Pyramid:
    points = ControlPoint(0.0, (1.0, 1.0, 1.0), 0.01), ControlPoint(255.0, (1.0, 0.0, 0.0), 0.5)
    transfer = make_transfer_function(TransferSpec(points), 1.0)
    return build_pyramid(make_volume(values, np.eye(4), "test"), transfer, spec=PyramidSpec(), error=ErrorSpec())


def test_an_even_volume_is_one_cell_or_all_voxels() -> None:
    pyramid = _pyramid(np.full((8, 8, 8), 100, np.uint8))
    error, counter = root_error(pyramid), _counter(pyramid)
    assert list(distinct_tolerances(error, counter)) == [1.0]
    assert spread_tolerances(error, counter, 10) == (1.0, 0.0)


def test_distinct_tolerances_end_where_the_cut_is_nearly_the_finest(pyramid: Pyramid) -> None:
    tolerances = list(distinct_tolerances(root_error(pyramid), _counter(pyramid)))
    assert tolerances[1] <= root_error(pyramid) < tolerances[0]
    assert all(a / b > 1.99 for a, b in pairwise(tolerances))
    assert {f"{tolerance:.0e}"[0] for tolerance in tolerances} <= {"1", "2", "5"}
    counts = [len(cut_pyramid(pyramid, tolerance)) for tolerance in tolerances]
    assert all(b > 1.03 * a for a, b in pairwise(counts))
    assert counts[0] == 1 and counts[-1] > 0.97 * len(cut_pyramid(pyramid, 1e-300))


def test_spread_tolerances_fall_and_their_cuts_grow(pyramid: Pyramid) -> None:
    for most in (3, 10):
        tolerances = spread_tolerances(root_error(pyramid), _counter(pyramid), most)
        assert 2 <= len(tolerances) <= most
        assert tolerances[-1] == 0 and list(tolerances) == sorted(tolerances, reverse=True)
        counts = [len(cut_pyramid(pyramid, tolerance)) for tolerance in tolerances]
        assert all(b > a for a, b in pairwise(counts))


def _counter(pyramid: Pyramid):  # type: ignore[no-untyped-def]
    return lambda tolerance: len(cut_pyramid(pyramid, tolerance))


@pytest.mark.parametrize("step", [1.0, 1.12])
def test_a_ladder_has_numbers_of_two_digits_that_differ_enough(pyramid: Pyramid, step: float) -> None:
    *ladder, last = tolerance_ladder(root_error(pyramid), _counter(pyramid), step)
    candidates = list(distinct_tolerances(root_error(pyramid), _counter(pyramid)))
    assert last == 0.0 and ladder[0] == candidates[0]
    assert all(step <= a / b < 1.11 * step + 0.01 for a, b in pairwise(ladder))
    assert all(tolerance == float(f"{tolerance:.1e}") for tolerance in ladder)  # no digit is lost in a scene
    assert candidates[-1] <= ladder[-1] < 1.11 * step * candidates[-1] + 0.01
