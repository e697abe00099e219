"""The sizes of cuts, against cuts: `splats: N` is the finest that there is, at a tolerance that a scene can have."""

from __future__ import annotations

import math
import sys
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from brickwork import transfer_of
from hypothesis import assume, given, settings, strategies as st
from small_scene import small_tree

from renderer.pyramid import (
    CutSizes,
    FinestCut,
    Pyramid,
    build_pyramid,
    cut_pyramid,
    cut_sizes,
    descendants,
    node_errors,
    root_cells,
)
from renderer.scene import MIN_TOLERANCE, ErrorSpec, PyramidSpec, parse_scene, tolerance_at
from renderer.transfer import TransferFunction
from renderer.volume import Array, Float64, Volume, make_volume

ERRORS = (ErrorSpec(), ErrorSpec(measure="rms"), ErrorSpec(measure="rms", of="scalar"))
ROOT = Path(__file__).resolve().parents[2]


SLOPE = transfer_of((0, (0, 0, 0), 0), (60, (0, 0.5, 1), 0), (250, (1, 0.5, 0.1), 3))


def volume_of(values: Array) -> Volume:
    """Return an anisotropic volume."""
    return make_volume(np.ascontiguousarray(values), np.diag([0.5, 1.0, 2.0, 1.0]), "test")


def build(of: Volume, error: ErrorSpec = ERRORS[0], spec: PyramidSpec | None = None) -> Pyramid:
    return build_pyramid(of, SLOPE, spec=spec or PyramidSpec(), error=error, num_threads=1)


def sizes_of(pyramid: Pyramid, max_cells: int = 10**9, finest: int = 0, finest_at_zero: int = 0) -> CutSizes:
    return cut_sizes(pyramid, max_cells, finest_level=finest, finest_level_at_zero=finest_at_zero)


@st.composite
def values(draw: st.DrawFn) -> Array:
    """Draw noise, a few values, terraces, mostly nothing, or one value: with ties and with empty parts."""
    shape = draw(st.tuples(*[st.integers(1, 13)] * 3))
    rng = np.random.default_rng(draw(st.integers(0, 99)))
    kind = draw(st.sampled_from(["noise", "few", "terraces", "sparse", "even"]))
    z, y, x = np.indices(shape)
    field = {
        "noise": rng.uniform(0, 250, shape),
        "few": rng.choice([0, 100, 250], shape),
        "terraces": 40.0 * ((x // 2 + y // 4 + z // 3) % 6),
        "sparse": np.where(rng.random(shape) < 0.1, 200, 0),
        "even": np.full(shape, draw(st.sampled_from([0, 200]))),
    }[kind]
    return np.asarray(field).astype(draw(st.sampled_from([np.uint8, np.float32])))


def all_node_errors(pyramid: Pyramid) -> Float64:
    """Return all different errors of nodes, falling."""
    found = []
    for number in range(pyramid.num_levels, 0, -1):
        nodes, cells = descendants(pyramid, *root_cells(pyramid), pyramid.num_levels, number)
        found.append(node_errors(pyramid, nodes, cells, number))
    return np.unique(np.concatenate(found))[::-1]


def all_cuts(pyramid: Pyramid, finest: int, finest_at_zero: int) -> list[tuple[float, int]]:
    """Return (tolerance, number of cells) by falling tolerance, of all different cuts."""
    errors = all_node_errors(pyramid).tolist()
    tolerances = {1e300} | {at for error in errors for at in (error, math.nextafter(error, math.inf)) if at > 0}
    found = [(at, len(cut_pyramid(pyramid, at, finest_level=finest))) for at in sorted(tolerances, reverse=True)]
    return [*found, (0.0, len(cut_pyramid(pyramid, 0.0, finest_level=finest_at_zero)))]


def assert_finest(pyramid: Pyramid, num: int, levels: tuple[int, int], cuts: list[tuple[float, int]]) -> None:
    found = sizes_of(pyramid, num, *levels).finest_within(num)
    best, most = min((at, cells) for at, cells in cuts if cells <= num)
    ours, theirs = (cut_pyramid(pyramid, at, finest_level=levels[at == 0]) for at in (found, best))
    assert len(ours) == most
    np.testing.assert_array_equal(ours.levels, theirs.levels)
    np.testing.assert_array_equal(ours.cells, theirs.cells)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    values=values(),
    error=st.sampled_from(ERRORS),
    spec=st.builds(PyramidSpec, st.sampled_from(["extinction", "opacity"]), st.sampled_from(["half", "single"])),
    levels=st.tuples(st.integers(0, 3), st.integers(0, 3)),
    share=st.floats(0, 1.1),
)
def test_the_finest_cut_within_a_budget_of_cells(
    values: Array, error: ErrorSpec, spec: PyramidSpec, levels: tuple[int, int], share: float
) -> None:
    pyramid = build(volume_of(values), error, spec)
    levels = max(levels), min(levels)
    cuts = all_cuts(pyramid, *levels)
    counts = [cells for _, cells in cuts]
    assert counts == sorted(counts)
    for num in {1, *(max(1, counts[-1] + k) for k in (-1, 0, 1)), max(1, round(share * counts[-1]))}:
        assert_finest(pyramid, num, levels, cuts)


def test_budgets_outside_the_computed_sizes_are_refused() -> None:
    sizes = sizes_of(build(volume_of(np.full((4, 4, 4), 200, np.uint8))), 20)
    for num in (0, 21):
        with pytest.raises(ValueError, match=rf"^sizes of other cuts: got {num}, expected 1 to 20$"):
            sizes.finest_within(num)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(values=values(), error=st.sampled_from(ERRORS), share=st.floats(0, 1), finest=st.integers(0, 2))
def test_a_pyramid_for_coarse_cuts_has_their_sizes(values: Array, error: ErrorSpec, share: float, finest: int) -> None:
    """Finer cuts count as too large."""
    of, spec = volume_of(values), PyramidSpec()
    whole = build(of, error)
    errors = all_node_errors(whole)
    errors = errors[errors > 0]
    assume(len(errors) > 0)
    least = float(errors[round(share * (len(errors) - 1))])
    for min_tolerance in (least, math.nextafter(least, 2 * least)):
        part = build_pyramid(
            of, SLOPE, spec=spec, error=error, num_threads=1, finest_cut=FinestCut(min_tolerance, finest)
        )
        most = len(cut_pyramid(whole, min_tolerance, finest_level=finest))
        for num in {1, 5, max(1, most - 1), most, 10 * most}:
            found = sizes_of(part, num, finest, finest).finest_within(num)
            assert found >= min_tolerance
            of_whole = sizes_of(whole, min(num, most), finest, finest).finest_within(min(num, most))
            pairs = (part, found), (whole, of_whole)
            counts = [len(cut_pyramid(pyramid, at, finest_level=finest)) for pyramid, at in pairs]
            assert counts[0] == counts[1] <= num


# Tolerances


TREE = small_tree()


def assert_legal(*tolerances: float) -> None:
    """A scene keeps tolerances unchanged, alone or by frame."""
    written = dict(enumerate(tolerances)) if len(tolerances) > 1 else tolerances[0]
    scene = parse_scene(TREE | {"error": {"tolerance": written}}, base=Path())
    assert [tolerance_at(scene.error, frame) for frame in range(len(tolerances))] == [*tolerances]


def made_sizes(divisions: list[float], beyond: float = 0.0) -> CutSizes:
    return CutSizes(np.array(divisions), np.arange(1, len(divisions) + 2), beyond, None, len(divisions) + 1)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    ends=st.tuples(*[st.floats(MIN_TOLERANCE, sys.float_info.max / 2)] * 2),
    beyond=st.booleans(),
    ulps=st.none() | st.integers(1, 9),
)
def test_tolerances_lie_between_split_thresholds_and_are_legal(
    ends: tuple[float, float], beyond: bool, ulps: int | None
) -> None:
    low, high = sorted(ends)
    if ulps:
        low = high * (1 - ulps * 2.0**-52)
    assume(MIN_TOLERANCE <= low < high)
    sizes = made_sizes([high], low) if beyond else made_sizes([high, low])
    above, between = sizes.finest_within(1), sizes.finest_within(2)
    assert above > high >= between > low
    assert_legal(above, between)
    # Between two numbers that differ by a share g lies one of -log10(g) digits, and a few.
    num_digits = max(1, math.ceil(1 - math.log10((high - low) / high)) + 1)
    assert float(f"{between:.{num_digits - 1}e}") == between or num_digits > 16


@pytest.mark.parametrize(
    ("scale", "precision"), [(5e-324, "half"), (1e-310, "single"), (1e-299, "half"), (1e300, "half"), (8e307, "single")]
)
def test_errors_at_the_ends_of_float64(scale: float, precision: Any) -> None:
    """Errors of scalars may be denormal, or nearly the largest number: sizes are right, and tolerances legal."""
    values = np.random.default_rng(3).choice(np.array([-1.0, 0.0, 1.0, 2.0]) * scale, (6, 7, 9))
    values[:2] = scale
    of = make_volume(values, np.eye(4), "ends")
    tf = TransferFunction(np.zeros(1), np.ones((1, 3)), np.ones(1), 1.0)
    pyramid = build_pyramid(of, tf, spec=PyramidSpec(precision=precision), error=ERRORS[2], num_threads=1)
    for num in (1, 2, 8, 30, 100, 377, 378):
        found = sizes_of(pyramid, num).finest_within(num)
        assert len(cut_pyramid(pyramid, found)) <= num
        assert_legal(found)
    if scale > 1e-299:  # else no tolerance but 0 divides anything
        assert len(cut_pyramid(pyramid, sizes_of(pyramid, 100).finest_within(100))) > 1


# Cost


def test_memory_grows_with_the_budget_and_not_with_the_volume() -> None:
    """Each cell of a budget takes 2 kB at most, in 128^3 voxels of noise with a million visible."""
    values = np.random.default_rng(0).integers(0, 256, (128, 128, 128), dtype=np.uint8)
    pyramid = build(make_volume(values, np.eye(4), "noise"))
    for num in (100, 3000):
        sizes_of(pyramid, num)  # compiled, and imported
        tracemalloc.start()
        found = sizes_of(pyramid, num).finest_within(num)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert len(cut_pyramid(pyramid, found)) <= num
        assert peak < 2000 * num + 20_000
