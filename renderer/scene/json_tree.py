"""Read JSON objects, which anybody may have edited: refuse cut-off files, infinite numbers and duplicate keys."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from renderer.errors import InputError, Problem, SceneError
from renderer.scene.message_text import format_value, join_keys
from renderer.scene.yaml_tree import TextPosition, with_excerpt

_MOST_DIGITS = 300  # integers of fewer digits are finite as float64, too


def load_json_object(text: str, path: Path, *, kind: str) -> dict[str, Any]:
    """Return the object in a text that begins with a brace.

    kind: the kind of the file, for messages.
    Raises InputError if the text is not JSON, and SceneError for all NaN, infinities and duplicate keys, which Python's
    parser accepts.
    """
    refused: list[Problem] = []

    def refuse(what: str, got: str | None = None, key: str = "") -> Problem:
        """Record a problem and return it in place of the refused value, so that its path is found later."""
        refused.append(Problem(key, what, got=got))
        return refused[-1]

    def make_object(pairs: list[tuple[str, Any]]) -> dict[str, Any] | Problem:
        found = dict(pairs)
        if len(found) == len(pairs):
            return found
        ordered = sorted(key for key, _ in pairs)
        return refuse("the same key twice", key=next(key for key, other in pairwise(ordered) if key == other))

    def make_float(digits: str) -> float | Problem:
        number = float(digits)
        return refuse("not a finite number", got=format_value(digits)) if math.isinf(number) else number

    def make_integer(digits: str) -> int | float | Problem:
        return int(digits) if len(digits) < _MOST_DIGITS else make_float(digits)

    try:
        data = json.loads(
            text,
            object_pairs_hook=make_object,
            parse_float=make_float,
            parse_int=make_integer,
            parse_constant=lambda name: refuse("not a finite number", got=name),
        )
    except json.JSONDecodeError as error:
        begin, end = text.rfind("\n", 0, error.pos) + 1, text.find("\n", error.pos)
        line = text[begin : end if end >= 0 else None]
        raise InputError(
            with_excerpt("not valid JSON", [line], TextPosition(1, error.colno)),
            where=f"{path}:{error.lineno}:{error.colno}",
            hint=f"{kind} is written as a whole: this one was cut off, or changed since",
        ) from error
    except RecursionError as error:
        raise InputError("not valid JSON: too many levels", where=str(path)) from error
    if refused:
        raise SceneError([replace(problem, location=str(path)) for problem in _problems_in(data)])
    assert isinstance(data, dict), "it begins with a brace"
    return data


def _problems_in(data: object) -> Iterator[Problem]:
    """Yield the problems in the data, in the order of the file. It is not recursive, as there may be many levels."""
    stack: list[tuple[str, object]] = [("", data)]
    while stack:
        path, item = stack.pop()
        if isinstance(item, Problem):
            yield replace(item, path=join_keys(path, item.path) if item.path else path)
        elif isinstance(item, dict):
            stack += [(join_keys(path, key), value) for key, value in reversed(item.items())]
        elif isinstance(item, list):
            stack += [(join_keys(path, index), value) for index, value in reversed(list(enumerate(item)))]


def is_plain_data(value: object, num_levels: int) -> bool:
    """Return whether unchecked data can be copied to another JSON file.

    The data may have at most `num_levels` levels, and finite numbers.
    """
    if isinstance(value, float):
        return math.isfinite(value)
    items = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return num_levels >= 0 and all(is_plain_data(item, num_levels - 1) for item in items)
