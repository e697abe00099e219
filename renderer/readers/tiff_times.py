"""Find the times of the steps in a TIFF file, in descriptions of ImageJ and OME."""

from __future__ import annotations

import html
import math
import re

from renderer.readers.text_header import NUMBER
from renderer.readers.tiff_description import attribute, is_imagej, is_ome, ome_pixels
from renderer.readers.steps_in_time import TimeSteps, even_steps_at, steps_at


def find_times(description: str, count: int) -> TimeSteps:
    """Return the steps in time, by the description of the first page; those of OME at the first plane of each."""
    if is_imagej(description):
        unit = re.search(r"^tunit=(.*)$", description, re.M)
        interval = re.search(r"^finterval=(\S*)", description, re.M)
        return even_steps_at(count, _number(interval and interval[1]), unit[1] if unit else "sec")
    if not is_ome(description):
        return TimeSteps(count)
    pixels = ome_pixels(description)
    even = even_steps_at(count, _number(attribute(pixels, "TimeIncrement")), _unit(pixels, "TimeIncrementUnit"))
    return even if even.times else _of_planes(description, count)


def _of_planes(description: str, count: int) -> TimeSteps:
    image = re.split(r"</(?:\w+:)?Pixels\b", description, maxsplit=1)[0]
    times, unit = dict[float, float](), "s"
    for plane in re.findall(r"<(?:\w+:)?Plane\b([^<>]*)>", image):
        number, time = (_number(attribute(plane, name)) for name in ("TheT", "DeltaT"))
        times[number], unit = min(times.get(number, math.inf), time), _unit(plane, "DeltaTUnit")
    return steps_at(count, [times.get(number, math.nan) for number in range(count)], unit)


def _number(text: str | None) -> float:
    return float(text) if text and NUMBER.fullmatch(text) else math.nan


def _unit(element: str, name: str) -> str:
    return html.unescape(attribute(element, name) or "s")
