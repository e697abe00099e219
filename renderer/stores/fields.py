"""Read values of JSON, which may have any type: a value of another type counts as missing."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

# The largest number of items of a list that are read: more than an image has axes, levels, channels or labels.
_MAX_ITEMS = 100_000


def mapping_of(value: object) -> Mapping[str, Any]:
    """Return a mapping, or an empty one in place of any other value."""
    return value if isinstance(value, dict) else {}


def list_of(value: object) -> Sequence[Any]:
    """Return the first items of a list, or an empty list in place of any other value."""
    return value[:_MAX_ITEMS] if isinstance(value, list) else []


def mappings_of(value: object) -> list[Mapping[str, Any]]:
    """Return the mappings in a list."""
    return [each for each in list_of(value) if isinstance(each, dict)]


def text_of(value: object) -> str:
    """Return a text, or an empty one in place of any other value."""
    return value if isinstance(value, str) else ""


def number_of(value: object) -> float:
    """Return a finite number, or NaN in place of any other value."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or abs(value) > 1e300:
        return math.nan
    return float(value)


def numbers_of(value: object, count: int) -> tuple[float, ...] | None:
    """Return a list of `count` finite numbers as a tuple; None for any other value."""
    found = tuple(map(number_of, list_of(value)))
    return found if len(found) == count and not any(map(math.isnan, found)) else None
