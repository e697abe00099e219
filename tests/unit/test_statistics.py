"""Histograms and percentiles, against numpy on whole arrays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from renderer.suggest import compute_statistics, rebin

DTYPES = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float16", "float32", "float64")


def mixture(*parts: tuple[float, float, int], seed: int = 0) -> np.ndarray:
    """Return samples of normal distributions, from (mean, deviation, number)."""
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.normal(mean, deviation, number) for mean, deviation, number in parts])


@pytest.mark.parametrize("dtype", DTYPES)
def test_against_numpy(dtype):
    rng = np.random.default_rng(3)
    kind = np.dtype(dtype)
    if kind.kind in "iu":
        values = rng.integers(np.iinfo(kind).min, np.iinfo(kind).max, (20, 30, 40), kind, endpoint=True)
    else:
        values = rng.normal(5, 100, (20, 30, 40)).astype(kind)
    statistics = compute_statistics(values)
    assert statistics.minimum == values.min()
    assert statistics.maximum == values.max()
    assert statistics.mean == pytest.approx(
        values.astype(np.float64).mean(), rel=1e-9, abs=1e-9 * float(np.ptp(values.astype(float)))
    )
    assert statistics.counts.sum() == values.size
    for percent, value in statistics.percentiles.items():
        assert value == np.percentile(values, percent, method="inverted_cdf").item()


@pytest.mark.parametrize("dtype", DTYPES)
@pytest.mark.parametrize("value", [0, 7])
def test_constant(dtype, value):
    statistics = compute_statistics(np.full((3, 4, 5), value, dtype))
    assert statistics.minimum == statistics.maximum == statistics.mean == statistics.percentiles[50] == value


@pytest.mark.parametrize("offset", [-(2**63), 2**63 - 1000])
def test_extreme_integers_do_not_wrap(offset):
    dtype = np.int64 if offset < 0 else np.uint64
    values = (np.arange(600, dtype=dtype) + dtype(offset)).reshape(5, 10, 12)
    statistics = compute_statistics(values)
    np.testing.assert_array_equal(statistics.counts, np.ones(600))


def test_floats_far_from_zero_and_of_tiny_range():
    values = np.array([1e9, 1e9 + 1, 1e9 + 2]).reshape(1, 1, 3)
    assert compute_statistics(values).percentiles[50] == 1e9 + 1
    assert compute_statistics(np.array([0.0, 5e-324]).reshape(1, 1, 2)).counts.sum() == 2


@pytest.mark.parametrize("dtype", ["int32", "int64", "float16", "float32", "float64"])
def test_percentiles_beside_outliers_are_values_of_the_volume(dtype, monkeypatch):
    """Percentiles are exact with zeros of either sign, values that differ in their last bits, and outliers."""
    monkeypatch.setattr("renderer.suggest.histogram._CHUNK", 1000)
    kind = np.dtype(dtype)
    ends = np.iinfo(kind) if kind.kind == "i" else np.finfo(kind)
    values = np.random.default_rng(5).integers(-9, 10, (10, 20, 30)).astype(kind)
    if kind.kind == "f":
        values[values == 0] *= -1
        values *= 1 + ends.eps
    values[0, 0, :2] = ends.min, ends.max
    for percent, value in compute_statistics(values).percentiles.items():
        assert value == np.percentile(values, percent, method="inverted_cdf").item()


@given(st.lists(st.integers(-300, 300), min_size=1, max_size=60), st.integers(1, 70))
def test_rebin_keeps_every_voxel_in_its_place(numbers, num_bins):
    values = np.array(numbers, np.int16)
    counts, edges = rebin(compute_statistics(values), num_bins)
    assert len(counts) <= num_bins
    assert len(edges) == len(counts) + 1
    np.testing.assert_array_equal(counts, np.histogram(values, edges)[0])
