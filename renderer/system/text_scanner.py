"""Read numbers and attributes in texts from outside, in time proportional to the length of the text.

Regular expressions do not backtrack: a repeat is followed by a character that it cannot take, and a search does not
begin again inside of a repeat.
"""

from __future__ import annotations

import math
import re

# A number, with or without a sign, a fraction and an exponent.
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
# The value of an attribute, after its name.
_VALUE = re.compile(r"""\s*=\s*(?:"([^"]*)"|'([^']*)')""")
# The most digits of a whole number. Python takes quadratic time for more, and refuses some thousands.
_MOST_DIGITS = 300


def number_in(text: str | None) -> float:
    """Return the number that a text spells; infinite if it is too large for a float, NaN for other texts."""
    return float(text) if text and _NUMBER.fullmatch(text) else math.nan


def whole_number_in(text: str | None) -> int | None:
    """Return the whole number that a text spells by digits, with or without a minus; None for other texts."""
    digits = (text or "").removeprefix("-")
    is_whole = digits.isascii() and digits.isdigit() and len(digits) <= _MOST_DIGITS
    return int(text or "") if is_whole else None


def attribute(element: str, name: str) -> str | None:
    """Return the value of an attribute of an XML element, in single or double quotes; None if it is missing."""
    at = element.find(name)
    while at >= 0:
        before = element[at - 1 : at] if at else " "
        found = _VALUE.match(element, at + len(name))
        if found and not (before.isalnum() or before == "_"):
            return found[1] if found[1] is not None else found[2]
        at = element.find(name, at + 1)
    return None


def unescaped(text: str) -> str:
    """Return a text of XML or HTML in which references are replaced by characters.

    It is unchanged if a reference has too many digits.
    """
    import html  # imported late, as its table of names takes a while to load

    try:
        return html.unescape(text)
    except ValueError:
        return text
