"""Describe a changed value of a scene: colours as hex, ranges and sizes as people write them, long lists shortened."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from renderer.scene import format_value, join_keys

# The keys whose lists of three numbers from 0 to 1 are colours.
_COLOR_KEYS = ("color", "background", "top", "bottom")
# The keys whose lists of two numbers are the ends of a range.
_RANGE_KEYS = ("range", "x", "y", "z")
# The keys whose lists of whole numbers are lengths.
_SIZE_KEYS = ("size", "shape")
# The most items of a list, or of a mapping, that are shown; of a longer one, the first and the last are.
_MOST_ITEMS = 6
# The number of first items, and of last ones, that are shown of a longer list.
_NUM_FIRST = 3
_NUM_LAST = 2
# The most levels of lists and mappings that are shown.
_MOST_LEVELS = 4
# The most characters of a text; of a longer one, the beginning and the end are shown.
_MAX_LENGTH = 160


def changed_value(path: str, was: Any, now: Any) -> tuple[str, str, str]:
    """Return the dotted path of a change, and both values as text; empty for a missing value.

    Of two long lists that differ in one place, the path is that of the place.
    """
    while (place := _only_place(path, was, now)) is not None:
        path, was, now = join_keys(path, place), was[place], now[place]
    before, after = (_shortened(_text(value, path, _MOST_LEVELS)) for value in (was, now))
    if before == after:  # they differ in digits or items that are not shown
        before, after = (_shortened(format_value(value)) for value in (was, now))
    return path, "" if was is None else before, "" if now is None else after


def _only_place(path: str, was: Any, now: Any) -> int | None:
    """Return the index of the one item in which two lists of equal length differ; None for lists shown as a whole."""
    if not isinstance(was, list) or not isinstance(now, list) or len(was) != len(now):
        return None
    if len(was) <= _MOST_ITEMS and not any(isinstance(item, list) for item in was):
        return None
    places = [index for index, items in enumerate(zip(was, now, strict=True)) if items[0] != items[1]]
    return places[0] if len(places) == 1 else None


def _text(value: Any, path: str, num_levels: int) -> str:
    """Return a value as text. path: its dotted path, of which the last key may say what it is."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, str):
        return repr(value)
    if not isinstance(value, (list, Mapping)):
        return format_value(value)
    if num_levels == 0:
        return "..."
    if isinstance(value, Mapping):
        pairs = [f"{join_keys('', key)}: {_text(item, str(key), num_levels - 1)}" for key, item in _some(value.items())]
        return f"{{{_joined(pairs, len(value))}}}"
    return _list_text(value, path.rpartition(".")[2], path, num_levels)


def _list_text(items: Sequence[Any], key: str, path: str, num_levels: int) -> str:
    numbers = [item for item in items if type(item) in (int, float)]
    texts = [_text(item, path, num_levels - 1) for item in _some(items)]
    if len(numbers) == len(items):
        if key in _COLOR_KEYS and len(items) == 3 and all(0 <= number <= 1 for number in numbers):
            return f"#{bytes(round(255 * number) for number in numbers).hex()}"
        if key in _RANGE_KEYS and len(items) == 2:
            return " to ".join(texts)
        if key in _SIZE_KEYS and 2 <= len(items) <= 3:
            return " x ".join(texts)
    return f"[{_joined(texts, len(items))}]"


def _some(items: Any) -> list[Any]:
    """Return all items of a short collection, or the first and the last ones of a longer one."""
    items = list(items)
    return items if len(items) <= _MOST_ITEMS else [*items[:_NUM_FIRST], *items[-_NUM_LAST:]]


def _joined(texts: Sequence[str], num: int) -> str:
    """Join the texts of a collection, with the number of those that are left out in their place."""
    if num > len(texts):
        texts = [*texts[:_NUM_FIRST], f"... {num - len(texts)} more ...", *texts[_NUM_FIRST:]]
    return ", ".join(texts)


def _shortened(text: str) -> str:
    """Return a text with at most _MAX_LENGTH characters, without its middle if it is longer."""
    if len(text) <= _MAX_LENGTH:
        return text
    half = (_MAX_LENGTH - 5) // 2
    return f"{text[:half]} ... {text[-half:]}"
