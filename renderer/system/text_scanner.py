"""Read numbers and attributes in texts from outside, in a time that goes with the length of the text.

Patterns are linear: after a repeat comes a character that the repeat does not take, and a search does not begin again
inside of one.
"""

from __future__ import annotations

import math
import re

_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_VALUE = re.compile(r"""\s*=\s*(?:"([^"]*)"|'([^']*)')""")
# Python refuses to convert integers of more digits than some thousands, and takes quadratic time for them.
_MOST_DIGITS = 300


def number_in(text: str | None) -> float:
    """Return the number that a text spells, infinite if it is too large for a float; NaN for all else."""
    return float(text) if text and _NUMBER.fullmatch(text) else math.nan


def whole_number_in(text: str | None) -> int | None:
    """Return the whole number that a text spells by digits alone, with or without a sign; None for all else."""
    digits = (text or "").removeprefix("-")
    is_whole = digits.isascii() and digits.isdigit() and len(digits) <= _MOST_DIGITS
    return int(text or "") if is_whole else None


def attribute(element: str, name: str) -> str | None:
    """Return the text of an attribute of an XML element, in either kind of quotes; None if it is missing."""
    at = element.find(name)
    while at >= 0:
        before = element[at - 1 : at] if at else " "
        found = _VALUE.match(element, at + len(name))
        if found and not (before.isalnum() or before == "_"):
            return found[1] if found[1] is not None else found[2]
        at = element.find(name, at + 1)
    return None


def unescaped(text: str) -> str:
    """Return a text of XML or HTML with characters in place of references; as it is where one has too many digits."""
    import html  # its table of names takes a while to load

    try:
        return html.unescape(text)
    except ValueError:
        return text
