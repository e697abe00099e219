"""Read numbers and attributes in texts from outside, in time proportional to the length of the text.

The regular expressions here never try a second way to match: a repeat is followed by a character that the repeat cannot
take, and a search does not begin again inside of a repeat.
"""

from __future__ import annotations

import math
import re

# Matches a number, with or without a sign, a fraction and an exponent.
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
# Matches the text after the name of an XML attribute: an equals sign and a value in quotes.
_VALUE = re.compile(r"""\s*=\s*(?:"([^"]*)"|'([^']*)')""")
# The largest number of digits of a whole number that is read. Python takes quadratic time for long numbers, and refuses
# numbers of some thousand digits.
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
    """Return a text of XML or HTML in which character references, such as `&lt;`, are replaced by the characters.

    If a reference has too many digits, the text is returned unchanged.
    """
    import html  # imported late, as its table of names takes a while to load

    try:
        return html.unescape(text)
    except ValueError:
        return text
