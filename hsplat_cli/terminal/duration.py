"""Reads a duration of the command line."""

from __future__ import annotations

import re

from renderer.errors import InputError
from renderer.scene import format_value

_NUMBER = r"(\d+(?:\.\d*)?)"
_FRACTION_ONLY_IN_LAST_PART = r"(?!.*\..*[hms].)"
_PARTS = f"(?=.)(?:{_NUMBER}h)?(?:{_NUMBER}m)?(?:{_NUMBER}s)?"
_DURATION = re.compile(f"{_FRACTION_ONLY_IN_LAST_PART}{_PARTS}|{_NUMBER}", re.ASCII)
_MOST_DIGITS = 9


def parse_duration(text: str, *, where: str) -> float:
    """Return the seconds in `90`, `90s`, `1.5m` or `1h30m`.

    A number without a unit stands alone; only the last part may have a fraction. Raises InputError for other text, and
    for 0 seconds.
    """
    match = _DURATION.fullmatch(text.strip()) if len(text) <= 3 * _MOST_DIGITS else None
    expected = "a time such as 90s, 10m or 1h30m"
    if match is None:
        raise InputError("not a duration", where=where, got=format_value(text), expected=expected)
    hours, minutes, seconds, bare = (float(part or 0) for part in match.groups())
    total = 3600 * hours + 60 * minutes + seconds + bare
    if total == 0:
        raise InputError("a duration of 0", where=where, got=format_value(text), expected=f"{expected}, more than 0")
    return total
