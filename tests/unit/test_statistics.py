"""Histograms and percentiles, against numpy on whole arrays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, strategies as st

from renderer.statistics import compute_statistics, rebin

DTYPES = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float16", "float32", "float64")


def assert_as_numpy_has_it(values):
    statistics = compute_statistics(values)
    assert (statistics.minimum, statistics.maximum) == (values.min(), values.max())
    wide = values.astype(np.float64)
    assert statistics.mean == pytest.approx(wide.mean(), rel=1e-9, abs=1e-9 * (wide.max() / 2 - wide.min() / 2))
    assert statistics.counts.sum() == values.size
    for percent, value in statistics.percentiles.items():
        assert value == np.percentile(values, percent, method="inverted_cdf").item()


@pytest.mark.parametrize("dtype", DTYPES)
def test_noise_and_constants(dtype):
    rng, kind = np.random.default_rng(3), np.dtype(dtype)
    noise = rng.normal(5, 100, (20, 30, 40)).astype(kind) if kind.kind == "f" else None
    if noise is None:
        noise = rng.integers(np.iinfo(kind).min, np.iinfo(kind).max, (20, 30, 40), kind, endpoint=True)
    for values in (noise, np.full((3, 4, 5), 0, dtype), np.full((3, 4, 5), 7, dtype)):
        assert_as_numpy_has_it(values)


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
    monkeypatch.setattr("renderer.statistics.histogram._CHUNK", 1000)
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


@pytest.mark.parametrize("dtype", ["uint8", "int8", "uint16", "int16"])
def test_counts_of_narrow_integers_in_several_slabs(dtype, monkeypatch):
    """Every slab counts, and slabs whose number of voxels is no multiple of any table's number."""
    monkeypatch.setattr("renderer.volume.slabs._SLAB_BYTES_OF_THREAD", 1001)
    ends = np.iinfo(dtype)
    values = np.random.default_rng(2).integers(max(ends.min, -300), min(ends.max, 300), (7, 11, 13)).astype(dtype)
    assert_as_numpy_has_it(values)
    statistics = compute_statistics(values)
    np.testing.assert_array_equal(statistics.counts, np.bincount(values.ravel().astype(int) - int(values.min())))


@pytest.mark.parametrize("dtype", ["float32", "int32", "float64"])
def test_a_sample_of_many_voxels(dtype, monkeypatch):
    """The range is of all voxels; counts and percentiles are of a part, the same each time, and near those of all."""
    monkeypatch.setattr("renderer.statistics.histogram._CHUNK", 500)
    monkeypatch.setattr("renderer.statistics.histogram.MOST_COUNTED", 10000)
    values = np.random.default_rng(3).integers(0, 10**6, (40, 40, 40)).astype(dtype)
    values[3, 4, 5], values[30, 4, 5] = -20000, 1020000
    whole, some = compute_statistics(values), compute_statistics(values, may_sample=True)
    assert (some.minimum, some.maximum, some.num_voxels) == (-20000, 1020000, 64000)
    assert not whole.is_of_sample and some.is_of_sample and 8000 <= some.num_counted <= 10000
    assert some.mean == pytest.approx(whole.mean, rel=0.02)
    assert some.percentiles == pytest.approx(whole.percentiles, rel=0.02, abs=5000)
    again = compute_statistics(values, may_sample=True)
    assert again.percentiles == some.percentiles and np.array_equal(again.counts, some.counts)


def test_all_voxels_count_if_a_sample_has_no_data_or_values_are_narrow(monkeypatch):
    monkeypatch.setattr("renderer.statistics.histogram._CHUNK", 10)
    monkeypatch.setattr("renderer.statistics.histogram.MOST_COUNTED", 100)
    sparse = np.full((10, 10, 10), np.nan, np.float32)
    sparse[9, 9, 9] = 7
    assert compute_statistics(sparse, may_sample=True).num_counted == 1
    narrow = compute_statistics(np.arange(1000, dtype=np.int16).reshape(10, 10, 10), may_sample=True)
    assert narrow.num_counted == narrow.num_voxels == 1000
