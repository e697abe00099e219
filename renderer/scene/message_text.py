"""Format values, keys, names and counts for messages: on one line, printable, and of a readable length."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate

from renderer.errors import closest_match
from renderer.system import printable

# The largest number of characters in a value in a message.
_MAX_VALUE_LENGTH = 60
# The largest number of characters in a text in a message. A matrix with all its digits has as many.
_MAX_TEXT_LENGTH = 200
# The largest number of characters in a key in a message. The longest name of a file has as many.
_MAX_KEY_LENGTH = 255
# The largest number of words in a list in a message.
_MAX_WORDS = 12
# The largest number of characters in a list in a message.
_MAX_LINE_LENGTH = 300


def format_value(value: object) -> str:
    """Return a value as a user would write it, on one line and cut to a readable length."""
    text = _flow(value, depth=0)
    return text if len(text) <= _MAX_VALUE_LENGTH else text[: _MAX_VALUE_LENGTH - 3] + "..."


def _flow(value: object, depth: int) -> str:
    """Return a value in YAML's flow style, at most three levels deep."""
    if not isinstance(value, (list, tuple, Mapping)):
        return _scalar(value)
    if depth == 3:
        return "..."
    if isinstance(value, Mapping):
        pairs = [
            f"{join_keys('', key)}: {_flow(item, depth + 1)}" for key, item in list(value.items())[:_MAX_VALUE_LENGTH]
        ]
        return "{" + ", ".join(pairs) + "}"
    return "[" + ", ".join(_flow(item, depth + 1) for item in value[:_MAX_VALUE_LENGTH]) + "]"


def _scalar(value: object) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int) and value.bit_length() > 4 * _MAX_VALUE_LENGTH:  # Python may refuse to print it
        return "a huge number"
    if isinstance(value, float):
        return repr(value).removesuffix(".0") if math.isfinite(value) else f".{value}"
    return repr(value[:_MAX_VALUE_LENGTH] if isinstance(value, str) else value)


def short_text(value: object, max_length: int = _MAX_TEXT_LENGTH) -> str:
    """Return a printable text of at most `max_length` characters unchanged, and other texts as `format_value` does."""
    is_short = isinstance(value, str) and printable(value) == value and len(value) <= max_length
    return str(value) if is_short else format_value(value)


def join_keys(path: str, key: object) -> str:
    """Return the dotted path of a mapping's key or a list's index below `path`."""
    name = short_text(key, _MAX_KEY_LENGTH)
    return f"{path}.{name}" if path else name


def join_words(names: Iterable[object], last: str = "or") -> str:
    """Return names as a list in words: `a, b or c`. last: the word before the last name."""
    *others, final = [str(name) for name in names]
    return f"{', '.join(others)} {last} {final}" if others else final


def join_some(words: Sequence[str], separator: str = ", ") -> str:
    """Return as many of the first words as fit into a line of a message, at least one, and the number of further words.

    The number is in words: `a, b and 3 more`.
    """
    ends = accumulate(len(word + separator) for word in words[:_MAX_WORDS])
    num = sum(end - len(separator) <= _MAX_LINE_LENGTH for end in ends)
    return first_few(words, max(num, 1), separator)


def did_you_mean(name: object, names: Iterable[str]) -> str | None:
    """Return the hint `did you mean ...?` with the one of `names` that is most similar; None if no name is similar."""
    close = closest_match(name, names) if isinstance(name, str) else None
    return f"did you mean {close}?" if close else None


def counted(num: int, one: str) -> str:
    """Return a number with its noun: `1 frame` or `2 frames`. one: the noun in the singular."""
    return f"{num} {one if num == 1 else f'{one}s'}"


def pluralize_range(nums: Sequence[int], one: str) -> str:
    """Return a range of counts with its noun: `190 bricks`, or `1 to 3 bricks`."""
    low, high = min(nums), max(nums)
    return counted(high, one) if low == high else f"{low} to {counted(high, one)}"


def first_few(items: Sequence[object], most: int = 3, between: str = ", ") -> str:
    """Return at most `most` of the items, and the number of further items: `a, b and 2 more`."""
    more = f" and {len(items) - most} more" if len(items) > most else ""
    return between.join(map(str, items[:most])) + more
