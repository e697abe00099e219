"""Find the voxels that have no data, and mark them by NaN.

A voxel has no data if it is NaN or infinite, if the scene or the file declares its value as absent, or if it has a
*fill value*: a number that many voxels have and that lies far from all others. If a voxel of an integer volume has no
data, the volume becomes floats that hold all of its integers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.readers.voxel_limits import check_memory
from renderer.scene import counted
from renderer.volume import Array, Bools, Float64, Int64, MappedFile, iter_slabs, kept_numbers, map_slabs

# The fill values that programs write by convention: of GIS, netCDF, CF, GSLIB and Surfer, and the largest and smallest
# numbers of the floating-point types.
_USUAL_VALUES = (
    -999.0,
    -9999.0,
    -99999.0,
    -32767.0,
    -32768.0,
    -(2.0**31),
    1e20,
    9.969209968386869e36,
    1e30,
    -1e30,
    1e31,
    1.70141e38,
    -1.70141e38,
    *(s * float(np.finfo(t).max) for s in (1, -1) for t in ("f4", "f8")),
)
# The largest relative difference between a value and a usual fill value that count as the same.
_SAME = 1e-6
# A usual fill value, such as -9999, marks voxels without data only if it is farther than this from the range of all
# values that are no usual fill values, in lengths of that range.
_MIN_USUAL_DISTANCE = 0.5
# A negative value that is not a usual fill value marks voxels without data only if it is farther than this from the
# range of the other values, in lengths of that range.
_MIN_NEGATIVE_DISTANCE = 3.0
# A positive value that is not a usual fill value marks voxels without data only if it is farther than this from the
# range of the other values, in lengths of that range. The limit is high, as a bright object may have a single value,
# too.
_MIN_DISTANCE = 30.0
# When usual fill values are sought, the range of all other values leaves out this share of the voxels at each end, so
# that a few outliers do not hide a fill value.
_OUTERMOST = 1e-3
# A value that is not a usual fill value marks voxels without data only if at least this share of the voxels has it.
_MIN_PART = 1e-3
# A value that is not a usual fill value marks voxels without data only if the volume has at least this many other
# distinct values. With fewer, the values are steps or labels.
_MIN_OTHER_VALUES = 16
# The number of voxels at random places among which fill values are sought.
_NUM_SAMPLES = 2**16
# float32 holds every integer up to this number exactly.
_FLOAT32_INTEGERS = 2**24

# Ranges of values, both ends included, that stand for no data.
Ranges = Sequence[tuple[float, float]]


def mark_absent(
    values: Array,
    file: MappedFile | None,
    nodata: Literal["auto", "none"] | tuple[float, ...],
    declared: Ranges,
    first_xyz: tuple[int, ...],
    elsewhere: Sequence[float] = (),
) -> tuple[Array, int, str | None]:
    """Return the values with NaN where there is no data, the number of such voxels, and a note on them.

    nodata: the scene's key, as in VolumeSpec. declared: the ranges that the file declares. first_xyz: the index of the
    first voxel, for messages. elsewhere: the fill values of other steps in time, which may be rare in this step.
    Values that are mapped from a file are copied before any is replaced. Raises InputError if no voxel has data, and
    with `nodata: none` for NaN and infinities.
    """
    if nodata == "none":
        _require_finite(values, file, first_xyz)
        return values, 0, None
    if nodata == "auto":
        finite = _finite_range(values, file)
        own = _fill_values(values, file, finite)
        points = (*own, *_beyond_data(values, [each for each in elsewhere if each not in own], own))
    else:
        points = nodata
    ranges = [*(declared if nodata == "auto" else ()), *((point, point) for point in points)]
    if not ranges and ((nodata == "auto" and not finite.num_others) or values.dtype.kind != "f"):
        return values, 0, None

    def count(_: int, slab: Array) -> Int64:
        """Return the numbers of voxels in each range, of NaN or infinite ones, and of all without data."""
        of_ranges = (np.count_nonzero(_are_within(slab, each)) for each in ranges)
        return np.array([*of_ranges, _num_nonfinite(slab), np.count_nonzero(_are_absent(slab, ranges))])

    *each, num_absent = sum(map_slabs(count, values, file), np.zeros(len(ranges) + 2, np.int64))
    nums = np.array(each)
    if not num_absent:
        return values, 0, None
    if num_absent == values.size:
        hint = None if nums[-1] else "`nodata: none` draws them"
        raise InputError("no voxel has data", got=_words(ranges, nums), expected="finite values", hint=hint)
    note = f"{num_absent} of {counted(values.size, 'voxel')} have no data: {_words(ranges, nums)}"
    if nodata == "auto" and not nums[-1]:
        note += "; `nodata: none` draws them"
    return _with_nan(values, ranges), int(num_absent), note


def _words(ranges: Ranges, nums: Array) -> str:
    """Return a text that lists the values of voxels without data."""
    words = [_in_words(low, high) for (low, high), num in zip(ranges, nums[:-1], strict=True) if num]
    return ", ".join([*["NaN or infinite"] * bool(nums[-1]), *dict.fromkeys(words)])


def _in_words(low: float, high: float) -> str:
    """Return a text for a range of values; an infinite range is `less than` or `more than` a number."""
    if low == high:
        return f"{low:.7g}"
    if low == -math.inf:
        return f"less than {math.nextafter(high, math.inf):.7g}"
    if high == math.inf:
        return f"more than {math.nextafter(low, -math.inf):.7g}"
    return f"{low:.7g} to {high:.7g}"


def _require_finite(values: Array, file: MappedFile | None, first_xyz: tuple[int, ...]) -> None:
    """Raise InputError if any value is NaN or infinite."""
    if values.dtype.kind != "f":
        return
    num_bad, first_bad = 0, ""
    for z, plane in enumerate(plane for slab in iter_slabs(values, file) for plane in slab):
        num = _num_nonfinite(plane)
        if num and not num_bad:
            y, x = np.argwhere(~np.isfinite(plane))[0]
            first_bad = ", ".join(str(first + int(at)) for first, at in zip(first_xyz, (x, y, z), strict=True))
        num_bad += num
    if num_bad:
        raise InputError(
            f"{num_bad} of {counted(values.size, 'voxel')} are NaN or infinite",
            got=f"the first at voxel x, y, z = {first_bad}",
            expected="finite values, with `nodata: none`",
            hint="`nodata: auto` leaves them out",
        )


def _num_nonfinite(values: Array) -> int:
    if np.isfinite([values.min(), values.max()]).all():  # a quick test: if any value is NaN, both are NaN
        return 0
    return values.size - int(np.count_nonzero(np.isfinite(values)))


def _are_within(values: Array, ends: tuple[float, float]) -> Bools:
    """Return which values lie in a range, or differ from one of its ends by rounding alone."""
    low, high = ends
    if values.dtype.kind == "f":
        low, high = low - _SAME * abs(low), high + _SAME * abs(high)
    with np.errstate(over="ignore"):  # an end may be too large for the type
        return np.asarray((values >= low) & (values <= high))


def _are_absent(values: Array, ranges: Ranges) -> Bools:
    absent = ~np.isfinite(values)
    for each in ranges:
        absent |= _are_within(values, each)
    return absent


def with_nan_where(
    values: Array, are_absent: Bools, allocate: Callable[[tuple[int, ...], np.dtype[Any]], Array]
) -> Array:
    """Return the values as floats, with NaN where they are absent; an array of floats is changed in place.

    allocate: returns an array of a shape and a type, for values that are not floats. It may use their memory.
    """
    dtype = _float_type(values.dtype, (plane[~absent] for plane, absent in zip(values, are_absent, strict=True)))
    marked = values
    if dtype != values.dtype:
        check_memory(values.nbytes)
        stored = values.copy()
        marked = allocate(values.shape, dtype)
        marked[...] = stored
    marked[are_absent] = np.nan
    return marked


def _float_type(dtype: np.dtype[Any], data: Iterable[Array]) -> np.dtype[Any]:
    """Return the smallest floating-point type that holds all values of `data`. dtype: the type of the values."""
    wide: np.dtype[Any] = np.promote_types(dtype, np.float16)
    if dtype.kind in "iu" and wide == np.float64:
        ends = (max(-int(some.min(initial=0)), int(some.max(initial=0))) for some in data)
        return np.dtype(np.float32) if all(end < _FLOAT32_INTEGERS for end in ends) else wide
    return wide


def _with_nan(values: Array, ranges: Ranges) -> Array:
    """Return the values as floats, with NaN where they lie in one of the ranges; a copy if the values are read-only."""
    dtype, marked = _float_type(values.dtype, (plane[~_are_absent(plane, ranges)] for plane in values)), values
    if dtype != values.dtype or not values.flags.writeable:
        check_memory(values.size * dtype.itemsize)
        marked = np.empty(values.shape, dtype)
    for plane, out in zip(values, marked, strict=True):
        absent = _are_absent(plane, ranges)
        if marked is not values:
            out[...] = plane
        out[absent] = np.nan
    return marked


def _beyond_data(values: Array, points: Sequence[float], own: Sequence[float]) -> list[float]:
    """Return the fill values of other steps in time that lie outside of the range of this step's values.

    points: the fill values of other steps. own: the fill values of this step, which do not count for the range.
    """
    sample = _sampled(values)
    sample = sample[np.isfinite(sample) & ~np.isin(sample, [*points, *own])]
    if not points or not sample.size:
        return []
    low, high = np.quantile(sample, (_OUTERMOST, 1 - _OUTERMOST), method="nearest").tolist()
    return [point for point in points if not low <= point <= high]


def _sampled(values: Array) -> Float64:
    """Return values at random places: places at regular distances might all have the same x."""
    places = np.random.default_rng(0).integers(values.size, size=_NUM_SAMPLES)
    return np.asarray(values.reshape(-1)[np.sort(places)], np.float64)


def find_fill_values(values: Array, file: MappedFile | None) -> tuple[float, ...]:
    """Return the fill values that the values alone reveal, in ascending order; values of one byte have none."""
    return _fill_values(values, file, _finite_range(values, file))


class _FiniteRange(NamedTuple):
    """The smallest and the largest finite value of an array, infinite if there is none, and the number of others."""

    low: float
    high: float
    num_others: int


def _finite_range(values: Array, file: MappedFile | None) -> _FiniteRange:
    """Return the range of the finite values of an array; of values of one byte, the range of their type."""
    if values.dtype.itemsize == 1:
        return _FiniteRange(float(np.iinfo(values.dtype).min), float(np.iinfo(values.dtype).max), 0)

    def measure(_: int, slab: Array) -> _FiniteRange:
        num = _num_nonfinite(slab)
        finite = slab[np.isfinite(slab)] if num else slab
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (math.inf, -math.inf)
        return _FiniteRange(low, high, num)

    def measure_all() -> _FiniteRange:
        lows, highs, nums = zip(*map_slabs(measure, values, file), strict=True)
        return _FiniteRange(min(lows), max(highs), sum(nums))

    return _FiniteRange(*kept_numbers("finite-range", values, file, measure_all))


def _fill_values(values: Array, file: MappedFile | None, finite: _FiniteRange) -> tuple[float, ...]:
    """Return fill values as `find_fill_values` does. finite: the range of the finite values."""
    if values.dtype.itemsize == 1:
        return ()
    sample = _sampled(values)
    sample = sample[np.isfinite(sample)]
    if finite.low <= finite.high:
        sample = np.append(sample, finite[:2])
    distinct, counts = np.unique(sample, return_counts=True)
    found = _usual_values(distinct, counts)
    distances = found | _far_values(distinct, counts, list(found))
    if not distances:
        return ()
    most = {value: _OUTERMOST * values.size * (value in found) for value in distances}
    counted = kept_numbers(
        "fill-values", values, file, lambda: _count_near(values, file, distances), facts=sorted(distances.items())
    )
    return tuple(sorted(value for value, num, num_near in counted if num > 1 and num_near <= most[value]))


def _count_near(
    values: Array, file: MappedFile | None, distances: Mapping[float, float]
) -> list[tuple[float, int, int]]:
    """Return each of some values, with the number of voxels that have it, and of others that are near it.

    distances: the distance within which others are near, by value.
    """
    nums, nums_near = dict.fromkeys(distances, 0), dict.fromkeys(distances, 0)
    for slab in _finite_slabs(values, file):
        others = slab[~np.isin(slab, list(distances))]  # fill values may lie near each other
        for value, distance in distances.items():
            nums[value] += np.count_nonzero(slab == value)
            nums_near[value] += np.count_nonzero(np.abs(others / 2 - value / 2) < distance / 2)
    return [(value, int(nums[value]), int(nums_near[value])) for value in distances]


def _finite_slabs(values: Array, file: MappedFile | None) -> Iterator[Array]:
    """Yield the finite values, slab by slab."""
    for slab in iter_slabs(values, file):
        finite = slab[np.isfinite(slab)] if _num_nonfinite(slab) else slab
        if finite.size:
            yield finite


def _usual_values(distinct: Float64, counts: Int64) -> dict[float, float]:
    """Return the usual fill values among values, ascending, each with the distance within which no other value lies."""
    are_usual = np.any([np.abs(distinct / each - 1) < _SAME for each in _USUAL_VALUES], axis=0)
    others, ranks = distinct[~are_usual], np.cumsum(counts[~are_usual])
    if not others.size or not are_usual.any():
        return {}
    low, high = others[np.searchsorted(ranks, np.array([_OUTERMOST, 1 - _OUTERMOST]) * ranks[-1])].tolist()
    distance = _MIN_USUAL_DISTANCE * (high / 2 - low / 2) * 2
    usual = distinct[are_usual]
    are_far = np.maximum(low / 2 - usual / 2, usual / 2 - high / 2) > distance / 2
    return dict.fromkeys(usual[are_far].tolist(), distance)


def _far_values(distinct: Float64, counts: Int64, known: Sequence[float]) -> dict[float, float]:
    """Return the lowest value, the highest one, or both, if they are frequent and far from all other values.

    Each value comes with the distance within which no other value lies. known: the usual fill values, which are not
    looked at.
    """
    rest = ~np.isin(distinct, known)
    distinct, counts = distinct[rest], counts[rest]
    is_frequent = counts >= max(2, _MIN_PART * counts.sum())
    for first, last in ((1, 1), (1, 0), (0, 1)):
        others = distinct[first : len(distinct) - last]
        outer = [0] * first + [-1] * last
        if len(others) < _MIN_OTHER_VALUES or not is_frequent[outer].all():
            continue
        half_range = float(others[-1] / 2 - others[0] / 2)
        gaps = [others[0] / 2 - distinct[0] / 2] * first + [distinct[-1] / 2 - others[-1] / 2] * last
        # Python's numbers, unlike numpy's, may become infinite without a warning.
        least = {
            value: (_MIN_NEGATIVE_DISTANCE if value < 0 else _MIN_DISTANCE) * half_range
            for value in distinct[outer].tolist()
        }
        if half_range > 0 and all(gap > distance for gap, distance in zip(gaps, least.values(), strict=True)):
            return {value: 2 * distance for value, distance in least.items()}
    return {}
