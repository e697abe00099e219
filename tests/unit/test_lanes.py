"""Lanes against numpy: every operation, at every number of lanes."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from types import FunctionType
from typing import Any

import numba
import numpy as np
import pytest
from commands import python

from renderer.compiled import (
    any_of,
    append,
    bits_to_float32,
    broadcast,
    fma,
    gather,
    lane_numbers,
    lanes,
    load,
    load_corners,
    load_rows,
    permute,
    store,
    store_rows,
    to_float32,
    to_float64,
    to_int32,
    where,
)

COUNTS = (4, 8, 16)
FLOATS = np.array([0.0, -0.0, 1.5, -2.25, np.inf, -np.inf, np.nan, 3e38, 1e-40, 7.0, -7.0, 0.1, 2.0, -1e-3, 5.5, 1e10])
INTS = np.array([0, 1, -1, 5, 2**31 - 1, -(2**31), 12, -12, 255, 256, 3, 2, -7, 99, 100, 1000])


def applied(function: Callable[..., Any], *columns: Any, dtype: Any, count: int = 16) -> Any:
    """Return what a function of lanes does to columns of sixteen values, `count` at a time."""
    inner = numba.njit(error_model="numpy")(function) if isinstance(function, FunctionType) else function
    arrays = tuple(np.ascontiguousarray(column) for column in columns)
    result = np.zeros(16, dtype)
    if len(arrays) == 1:

        @numba.njit(error_model="numpy")
        def run(a: Any, result: Any) -> None:
            for at in range(0, 16, count):
                store(result, at, inner(load(a, at, count)))
    else:

        @numba.njit(error_model="numpy")
        def run(a: Any, b: Any, result: Any) -> None:
            for at in range(0, 16, count):
                store(result, at, inner(load(a, at, count), load(b, at, count)))

    run(*arrays, result)
    return result


def bits(values: Any) -> Any:
    """Return values as bytes, all NaN alike."""
    return np.where(np.isnan(values), np.nan, values).tobytes()


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("count", COUNTS)
def test_arithmetic_of_floats(dtype: Any, count: int) -> None:
    def compute(a: Any, b: Any) -> Any:
        c = a + b
        c += -a * b
        return max(c / b, -a) + where(a < b, abs(a), min(np.sqrt(abs(b)), a)) * where(~(~(a >= b) & (b > a)), a, b)

    a, b = FLOATS.astype(dtype), np.roll(FLOATS, 5).astype(dtype)
    with np.errstate(all="ignore"):
        c = a + b
        c = c + -a * b
        first, root = c / b, np.sqrt(abs(b))
        first = np.where(-a > first, -a, first)
        expected = first + np.where(a < b, abs(a), np.where(a < root, a, root)) * np.where(~(~(a >= b) & (b > a)), a, b)
    assert bits(applied(compute, a, b, dtype=dtype, count=count)) == bits(expected)


@pytest.mark.parametrize("count", COUNTS)
def test_arithmetic_of_integers(count: int) -> None:
    def compute(a: Any, b: Any) -> Any:
        return where(a == b, a & b, (a * np.int32(3) + b) << np.int32(2)) + (-a >> np.int32(8)) - b

    a, b = INTS.astype(np.int32), np.roll(INTS, 3).astype(np.int32)
    b[4] = a[4]
    expected = np.where(a == b, a & b, (a * np.int32(3) + b) << 2) + (-a >> 8) - b
    assert applied(compute, a, b, dtype=np.int32, count=count).tolist() == expected.tolist()


@pytest.mark.parametrize("count", COUNTS)
def test_a_number_goes_to_all_lanes(count: int) -> None:
    def compute(a: Any) -> Any:
        total = 0.5  # a number that becomes lanes
        for _ in range(3):
            total = fma(a, 2.0, total)
        return max(where(a > 1.0, 3.0, 4.0), 1.0 + total) * broadcast(2.0, count)

    a = np.arange(16.0)
    expected = 2 * np.maximum(np.where(a > 1, 3, 4), 1.5 + 6 * a)
    assert applied(compute, a, dtype=np.float64, count=count).tolist() == expected.tolist()


@pytest.mark.parametrize("count", COUNTS)
def test_conversions(count: int) -> None:
    a = np.array([0.0, 1.9, -1.9, 2.5, -0.5, 1e6 + 0.7, -1e6, 3.0] * 2, np.float32)
    assert applied(to_int32, a, dtype=np.int32, count=count).tolist() == a.astype(np.int32).tolist()
    assert applied(to_float64, a, dtype=np.float64, count=count).tolist() == a.tolist()
    wide = a.astype(np.float64) + 1e-12
    assert applied(to_float32, wide, dtype=np.float32, count=count).tolist() == wide.astype(np.float32).tolist()
    number = INTS.astype(np.int32)
    assert applied(to_float32, number, dtype=np.float32, count=count).tolist() == [float(np.float32(x)) for x in INTS]
    got = applied(bits_to_float32, number, dtype=np.float32, count=count)
    assert got.tobytes() == number.tobytes()


def test_fma_rounds_once() -> None:
    """Against exact fractions; the products lose all digits to a sum that rounds twice."""
    rng = np.random.default_rng(5)
    x, y = (rng.uniform(1, 2, 16).astype(np.float32) for _ in range(2))
    got = applied(lambda a, b: fma(a, b, -(a * b)), x, y, dtype=np.float32)
    exact = [Fraction(float(a)) * Fraction(float(b)) - Fraction(float(a * b)) for a, b in zip(x, y, strict=True)]
    assert [Fraction(float(value)) for value in got] == exact


@pytest.mark.parametrize("count", COUNTS)
def test_memory(count: int) -> None:
    """Rows, corners and single elements at places of each lane's own, and rows appended for some lanes."""

    @numba.njit
    def run(texels: Any, at: Any, table: Any, out: Any, rows: Any, numbers: Any, four: Any) -> Any:
        place = load(at, 0, count)
        a, b, c, d, e, f, g, h = load_corners(texels, place, 5, 20)
        for k, corner in enumerate((a, b, c, d, e, f, g, h)):
            store(out, 16 * k, corner)
        p, q, r, s, t, u, v, w = load_rows(texels, place, 8)
        for k, column in enumerate((p, q, r, s, t, u, v, w)):
            store(out, 16 * (8 + k), column)
        store(out, 16 * 16, gather(texels, place))
        store(out, 16 * 17, permute(load(table, 0, count), place & np.int32(count - 1)))
        odd = (place & np.int32(1)) == np.int32(1)
        append(numbers, 1, odd, lane_numbers(count))
        store_rows(four, (a, b, c, d))
        return append(rows, 1, odd, (a, b, c, d, e, f, g, h)), any_of(odd), any_of(place < np.int32(0))

    rng = np.random.default_rng(3)
    texels, at = rng.random(100, np.float32), rng.integers(0, 60, 16).astype(np.int32)
    at[:2] = 1, 2  # odd and even
    table, out = rng.random(16, np.float32), np.zeros((18, 16), np.float32)
    rows, numbers, four = np.zeros((18, 8), np.float32), np.zeros(18, np.int32), np.zeros((16, 4), np.float32)
    num, has_odd, has_negative = run(texels, at, table, out.reshape(-1), rows.reshape(-1), numbers, four.reshape(-1))
    at, odd = at[:count], np.flatnonzero(at[:count] % 2)
    corners = texels[at[:, None] + [0, 1, 5, 6, 20, 21, 25, 26]]
    assert np.array_equal(out[:8, :count].T, corners)
    assert np.array_equal(out[8:16, :count].T, texels[at[:, None] + np.arange(8)])
    assert np.array_equal(out[16, :count], texels[at])
    assert np.array_equal(out[17, :count], table[at % count])
    assert (num, has_odd, has_negative) == (1 + len(odd), True, False)
    assert np.array_equal(rows[1:num], corners[odd]) and not rows[0].any()
    assert np.array_equal(numbers[1:num], odd)
    assert np.array_equal(four[:count], corners[:, :4])


def test_two_kinds_of_lanes_do_not_mix() -> None:
    a = np.ones(16, np.float32)
    with pytest.raises(numba.TypingError):
        applied(lambda x: x + to_float64(x), a, dtype=np.float64)


@pytest.mark.parametrize(("processor", "count"), [("haswell", 8), ("x86-64", 4), ("skylake-avx512", 16)])
def test_registers_are_the_processor_s(processor: str, count: int) -> None:
    if lanes.cpu_target.target_context.codegen().magic_tuple()[0].split("-")[0] != "x86_64":
        pytest.skip("the processor has other registers")
    program = "from renderer.compiled import num_lanes; print(num_lanes())"
    got = python("-c", program, NUMBA_CPU_NAME=processor, NUMBA_CPU_FEATURES="")
    assert int(got.stdout) == count
