"""Find the times of the steps in a TIFF file, in descriptions of ImageJ and OME."""

from __future__ import annotations

import math
import re

from renderer.readers.steps_in_time import TimeSteps, even_steps_at, steps_at
from renderer.readers.tiff_description import is_imagej, is_ome, ome_elements, ome_pixels
from renderer.system import attribute, number_in, unescaped

# The time between two steps, as ImageJ or OME writes it.
_STEP = re.compile(r"""(?:^finterval=|\bTimeIncrement\s*=\s*["'])([^"'\s]*)""", re.MULTILINE)
# The unit of the time between two steps, as ImageJ or OME writes it.
_UNIT = re.compile(r"""(?:^tunit=|\bTimeIncrementUnit\s*=\s*["'])([^"'\n]*)""", re.MULTILINE)


def find_times(description: str, count: int) -> TimeSteps:
    """Return the steps in time, by the description of the first page.

    If OME states no time between steps, each step has the time of its earliest plane.
    """
    if not is_imagej(description) and not is_ome(description):
        return TimeSteps(count)
    fields = ome_pixels(description) if is_ome(description) else description
    step, unit = _STEP.search(fields), _UNIT.search(fields)
    even = even_steps_at(count, number_in(step and step[1]), unescaped(unit[1]) if unit else "s")
    return even if even.times or is_imagej(description) else _of_planes(description, count)


def _of_planes(description: str, count: int) -> TimeSteps:
    times, unit = dict[float, float](), "s"
    for plane in ome_elements(description, "Plane"):
        number, time = (number_in(attribute(plane, name)) for name in ("TheT", "DeltaT"))
        times[number], unit = min(times.get(number, math.inf), time), attribute(plane, "DeltaTUnit") or "s"
    return steps_at(count, [times.get(number, math.nan) for number in range(count)], unescaped(unit))
