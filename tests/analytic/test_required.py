"""A pyramid holds what the scene can ask for, and what is left out changes no cut and no framing."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from brickwork import transfer_of
from dense_bricks import OBLIQUE
from hypothesis import given, settings, strategies as st

from renderer.pyramid import FinestCut, Pyramid, build_pyramid, cut_pyramid, cut_sizes
from renderer.scene import ErrorSpec, PyramidSpec
from renderer.transfer import TransferFunction
from renderer.view import visible_points
from renderer.volume import Volume, make_volume

MEASURES = {"optical": ErrorSpec(), "rms": ErrorSpec(measure="rms"), "scalar": ErrorSpec(measure="rms", of="scalar")}


def terraces(shape: tuple[int, int, int], dtype: Any, seed: int) -> Volume:
    """Regions of one value, noise, and gradients: subtrees whose error is 0, large, and in between."""
    rng = np.random.default_rng(seed)
    z, y, x = np.indices(shape)
    field = np.where((x // 11 + y // 7) % 3 == 0, 90.0, 0.0) + np.where(z % 29 < 9, 2.0 * x, 0.0)
    field += np.where((y > shape[1] // 2) & (z > shape[0] // 3), rng.uniform(0, 200, shape), 0.0)
    return make_volume(np.clip(field, 0, 250).astype(dtype), OBLIQUE, "terraces")


SLOPE = transfer_of((0, (0, 0, 0), 0), (60, (0, 0.5, 1), 0), (250, (1, 0.5, 0.1), 0.4))


def built(volume: Volume, **options: Any) -> Pyramid:
    return build_pyramid(volume, SLOPE, **({"spec": PyramidSpec(), "error": ErrorSpec()} | options))


def num_nodes(pyramid: Pyramid) -> list[int]:
    return [len(level.errors) for level in pyramid.levels]


def assert_same_cut(whole: Pyramid, part: Pyramid, tolerance: float, finest_level: int = 0) -> None:
    cuts = [cut_pyramid(pyramid, tolerance, finest_level=finest_level) for pyramid in (whole, part)]
    for name in ("levels", "cells", "depths"):
        np.testing.assert_array_equal(getattr(cuts[0], name), getattr(cuts[1], name))


@settings(max_examples=40, deadline=None)
@given(
    volume=st.builds(
        terraces, st.tuples(*[st.integers(1, 40)] * 3), st.sampled_from([np.uint8, np.float32]), st.integers(0, 5)
    ),
    error=st.sampled_from(list(MEASURES.values())),
    spec=st.builds(PyramidSpec, st.sampled_from(["extinction", "opacity"]), st.sampled_from(["half", "single"])),
    least=st.floats(-8, 3).map(lambda exponent: 10.0**exponent),
    finest_level=st.integers(0, 5),
)
def test_what_is_left_out_changes_no_cut(
    volume: Volume, error: ErrorSpec, spec: PyramidSpec, least: float, finest_level: int
) -> None:
    whole = built(volume, spec=spec, error=error)
    part = built(volume, spec=spec, error=error, finest_cut=FinestCut(least, finest_level))
    assert all(some <= all_ for some, all_ in zip(num_nodes(part), num_nodes(whole), strict=True))
    for tolerance in (least, 1.5 * least, 100 * least):
        assert_same_cut(whole, part, tolerance, finest_level)
        assert_same_cut(whole, part, tolerance, finest_level + 1)
    np.testing.assert_array_equal(visible_points(whole), visible_points(part))


@pytest.mark.parametrize("measure", MEASURES)
def test_where_the_error_decides_little_is_left(measure: str) -> None:
    """Of a volume of large even regions a film at one tolerance needs the nodes at the borders only."""
    z, y, x = np.indices((64, 64, 64))
    ball = (z - 32) ** 2 + (y - 32) ** 2 + (x - 32) ** 2 < 28**2
    volume = make_volume(np.where(ball, 200, 80).astype(np.uint8), np.eye(4), "ball")
    error = MEASURES[measure]
    whole, part = built(volume, error=error), built(volume, error=error, finest_cut=FinestCut(1e-2))
    assert num_nodes(whole)[:2] == [32**3, 16**3]
    assert num_nodes(part)[0] < 0.45 * 32**3
    assert num_nodes(part)[2:] == num_nodes(whole)[2:]


@pytest.mark.parametrize("finest_level", [2, 3, 9])
def test_levels_below_the_finest_are_not_stored(finest_level: int) -> None:
    volume = terraces((40, 40, 40), np.uint8, 0)
    whole, part = built(volume), built(volume, finest_cut=FinestCut(level=finest_level))
    # A leaf of level 3 stands for all of its block, so that level 3 is always there.
    first = min(finest_level, 3)
    assert num_nodes(part) == [0] * (first - 1) + num_nodes(whole)[first - 1 :]


def test_a_cut_that_was_not_announced_is_refused() -> None:
    pyramid = built(terraces((9, 9, 9), np.uint8, 0), finest_cut=FinestCut(0.1))
    with pytest.raises(ValueError, match=r"^no pyramid for this tolerance: got 0\.09, expected at least 0\.1$"):
        cut_pyramid(pyramid, 0.09)
    pyramid = built(terraces((9, 9, 9), np.uint8, 0), finest_cut=FinestCut(level=2))
    with pytest.raises(ValueError, match=r"^no pyramid for this level: got 1, expected at least 2$"):
        cut_pyramid(pyramid, 0.1, finest_level=1)
    for levels in ((2, 1), (1, 2)):
        with pytest.raises(ValueError, match=r"^no pyramid for this level: got 1, expected at least 2$"):
            cut_sizes(pyramid, 9, finest_level=levels[0], finest_level_at_zero=levels[1])


@pytest.mark.parametrize(("dtype", "average"), [(np.uint8, "extinction"), (np.float32, "opacity")])
def test_a_visible_voxel_is_found_wherever_it_is(dtype: Any, average: Any) -> None:
    """In a block that shows nothing else; a spike between two scalars of a block that are not visible is found, too."""
    spike = TransferFunction(np.array([-10.0, 5, 6, 7, 20]), np.ones((5, 3)), np.array([0.0, 0, 0.5, 0, 0]), 1.0)
    for index in [(0, 0, 0), (7, 7, 7), (8, 0, 13), (16, 16, 16), (3, 16, 9)]:
        values = np.full((17, 17, 17), 3, dtype)
        values[0, 0, 1] = 19
        values[index] = 6
        pyramid = build_pyramid(make_volume(values, np.eye(4), ""), spike, spec=PyramidSpec(average), error=ErrorSpec())
        cut = cut_pyramid(pyramid, 0.0)
        assert [tuple(cell[::-1]) for cell in cut.cells] == [index]
        assert num_nodes(pyramid) == [1] * 5


def test_nothing_is_stored_of_what_is_transparent() -> None:
    values = np.zeros((129, 64, 70), np.uint8)
    pyramid = built(make_volume(values, np.eye(4), ""))
    assert num_nodes(pyramid) == [0] * 8
    assert len(cut_pyramid(pyramid, 0.0)) == len(cut_pyramid(pyramid, 1e9)) == 0
    values = values.copy()
    values[40:53, 20:33, 9:22] = 200  # 0.4 % of the volume
    pyramid = built(make_volume(values, np.eye(4), ""))
    assert pyramid.num_bytes < 40 * 13**3 / 8
