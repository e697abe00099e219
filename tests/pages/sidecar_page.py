"""The tables of keys of the site's page of the sidecar, made from the records of a film."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from typing import Any, get_args, get_type_hints

from renderer.record import SIDECAR, FilmRecord
from renderer.scene import schema

# Short words for the values that most keys have; the page says what they mean.
_SHORT = {
    "a number from 0 to 1e+100": "number",
    "a whole number of at least 0": "count",
    "a whole number from 0 to 999999": "frame",
    "a number from -200 to 200": "decibels",
    "32 hexadecimal digits": "digest",
    "a list of numbers": "numbers",
    "a list": "list",
    "a mapping": "mapping",
    "a number": "number, also below 0",
}


def key_tables() -> Iterator[str]:
    """Yield the lines of a section for each class of records, the file first."""
    records = _records()
    titles = {cls: " and ".join(paths) or "The file" for cls, paths in records.items()}
    for cls, title in titles.items():
        yield from (f"### {title}", "", "| Key | Value | Meaning |", "|---|---|---|")
        if cls is FilmRecord:
            yield f"| `format` | {SIDECAR.format_line} | The version of this format. |"
        hints, types = get_type_hints(cls, include_extras=True), schema.field_table(cls)
        for field in dataclasses.fields(cls):
            meaning, value = hints[field.name].__metadata__[-1], _short(types[field.name].expected)
            for section in _sections_in(hints[field.name].__origin__):
                anchor = re.sub(r"[^\w\- ]", "", titles[section].lower()).replace(" ", "-")
                value = f"[{'list of mappings' if 'a list' in types[field.name].expected else 'mapping'}](#{anchor})"
            is_optional = field.default is not dataclasses.MISSING and not field.default
            yield f"| `{field.name}` | {value}{', optional' * is_optional} | {meaning} |"
        yield ""


def _records() -> dict[Any, list[str]]:
    """Return the classes of records, each with the paths of the keys that have it."""
    found: dict[Any, list[str]] = {FilmRecord: []}
    todo = [("", FilmRecord)]
    for path, cls in todo:
        for name, hint in get_type_hints(cls, include_extras=True).items():
            for section in _sections_in(hint.__origin__):
                inner = f"{path}{name}"
                found.setdefault(section, []).append(f"`{inner}`")
                todo.append((f"{inner}.", section))
    return found


def _sections_in(kind: Any) -> list[Any]:
    """Return the class of records that a type names, alone, optional or in a tuple."""
    return [each for each in (kind, *get_args(kind)) if getattr(each, "__module__", "") == FilmRecord.__module__]


def _short(expected: str) -> str:
    """Return the value of a key in short words."""
    found = next((each for each in _SHORT if expected.startswith(each)), "")
    return _SHORT.get(found, "") + expected.removeprefix(found)
