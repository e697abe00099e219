"""Hold the number and the times of a volume's steps in time, as far as a file states them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

# The spellings of each unit of time, by its length in seconds.
_UNITS = {
    1.0: "s sec secs second seconds",
    1e-3: "ms msec millisecond milliseconds",
    1e-6: "us \u00b5s \u03bcs usec microsecond microseconds",
    1e-9: "ns nsec nanosecond nanoseconds",
    60.0: "min minute minutes",
    3600.0: "h hr hour hours",
    86400.0: "d day days",
}
_SECONDS = {unit: seconds for seconds, units in _UNITS.items() for unit in units.split()}
# The most steps that are read as a sample of all of them: reading a step takes as long as reading a volume.
_MOST_STEPS = 5


class TimeSteps(NamedTuple):
    """The number of steps, and their times in ascending order, or no times if the file does not state them.

    time_unit: `s`, or an empty text for an unknown unit.
    """

    num_times: int = 1
    times: tuple[float, ...] = ()
    time_unit: str = ""


def steps_at(count: int, times: Sequence[float], unit: str) -> TimeSteps:
    """Return steps at given times; without times unless there is one for each step, and they ascend."""
    seconds = _SECONDS.get(unit.strip().lower(), 0.0)
    found = tuple(time * (seconds or 1.0) for time in times)
    ascends = all(before < time for before, time in pairwise(found)) and all(map(math.isfinite, found))
    return TimeSteps(count, found, "s" if seconds else "") if ascends and len(found) == count > 1 else TimeSteps(count)


def even_steps_at(count: int, step: float, unit: str, first: float = 0.0) -> TimeSteps:
    """Return steps at even times; without times if the numbers are not finite or do not ascend."""
    start = first if math.isfinite(first) else 0.0
    return steps_at(count, [start + k * step for k in range(count)], unit)


def some_steps(count: int) -> list[int]:
    """Return the indices of evenly chosen steps, the first and the last among them. count: the number of all steps."""
    return [*dict.fromkeys(k * (count - 1) // (_MOST_STEPS - 1) for k in range(_MOST_STEPS))]
