"""The steps of a volume in time: how many there are, and when each is, as far as a file says."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

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
# The most steps that are read to learn about all of them: each takes as long as a volume.
_MOST_STEPS = 5


class TimeSteps(NamedTuple):
    """A count of steps with the time of each, ascending; none where the file does not say.

    time_unit: `s`, or empty where the unit is not known.
    """

    num_times: int = 1
    times: tuple[float, ...] = ()
    time_unit: str = ""


def steps_at(count: int, times: Sequence[float], unit: str) -> TimeSteps:
    """Return steps at these times in a unit; without times where there is not one for each, all ascending."""
    seconds = _SECONDS.get(unit.strip().lower(), 0.0)
    found = tuple(time * (seconds or 1.0) for time in times)
    ascends = all(before < time for before, time in pairwise(found)) and all(map(math.isfinite, found))
    return TimeSteps(count, found, "s" if seconds else "") if ascends and len(found) == count > 1 else TimeSteps(count)


def even_steps_at(count: int, step: float, unit: str, first: float = 0.0) -> TimeSteps:
    """Return steps at even times in a unit; without times where these are no numbers."""
    start = first if math.isfinite(first) else 0.0
    return steps_at(count, [start + k * step for k in range(count)], unit)


def some_steps(count: int) -> list[int]:
    """Return the numbers of some of so many steps, evenly, the first and the last among them."""
    return [*dict.fromkeys(k * (count - 1) // (_MOST_STEPS - 1) for k in range(_MOST_STEPS))]
