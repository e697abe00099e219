"""Hold the number and the times of a volume's steps in time, as far as a file states them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

# The spellings of each unit of time, by the length of the unit in seconds.
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
# The largest number of steps in time that are read as a sample of all steps: reading a step takes as long as reading a
# volume.
_MOST_STEPS = 5


class TimeSteps(NamedTuple):
    """The steps in time of a volume, as far as a file states them.

    num_times: the number of steps. times: the time of each step, in ascending order; empty if unknown. time_unit: `s`,
    or an empty text for an unknown unit.
    """

    num_times: int = 1
    times: tuple[float, ...] = ()
    time_unit: str = ""


def steps_at(count: int, times: Sequence[float], unit: str) -> TimeSteps:
    """Return `count` steps at given times. They have no times unless there is a time for each step and times ascend."""
    seconds = _SECONDS.get(unit.strip().lower(), 0.0)
    found = tuple(time * (seconds or 1.0) for time in times)
    ascends = all(before < time for before, time in pairwise(found)) and all(map(math.isfinite, found))
    return TimeSteps(count, found, "s" if seconds else "") if ascends and len(found) == count > 1 else TimeSteps(count)


def even_steps_at(count: int, step: float, unit: str, first: float = 0.0) -> TimeSteps:
    """Return `count` steps at even times. They have no times if `step` is not finite and positive."""
    start = first if math.isfinite(first) else 0.0
    return steps_at(count, [start + k * step for k in range(count)], unit)


def some_steps(count: int) -> list[int]:
    """Return the indices of a few evenly chosen steps in time, the first and the last among them.

    count: the number of all steps.
    """
    return [*dict.fromkeys(k * (count - 1) // (_MOST_STEPS - 1) for k in range(_MOST_STEPS))]
