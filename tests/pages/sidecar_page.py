"""The keys in docs/sidecar.md, made from the records of a film: `python tests/pages/sidecar_page.py` writes them."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_type_hints

from renderer.record import SIDECAR, FilmRecord
from renderer.scene import schema

PAGE = Path(__file__).resolve().parents[2] / "docs" / "sidecar.md"
_HEAD = """\
## Keys

This section is made from `renderer/record/film_record.py` by `tests/pages/sidecar_page.py`. A key in italics may be
left out. A number is from 0 to 1e+100, a count a whole number of 0 or more, a frame a whole number to 999999; decibels
are from -200 to 200. A digest has 32 hexadecimal digits. Keys with *below* have a section.
"""
# Short words for the values that most keys have.
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


def sidecar_page() -> str:
    """Return the content of docs/sidecar.md: its text, with the lists of keys as the last section."""
    text, _, _ = PAGE.read_text("utf-8").partition(_HEAD.splitlines()[0] + "\n")
    return "\n".join([text + _HEAD, *("\n".join(_list(cls, paths)) for cls, paths in _records().items())])


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


def _list(cls: Any, paths: list[str]) -> Iterator[str]:
    yield f"### {' and '.join(paths) or 'The file'}"
    yield ""
    if cls is FilmRecord:
        yield f"- `format` ({SIDECAR.format_line}): The version of this format."
    hints, types = get_type_hints(cls, include_extras=True), schema.field_table(cls)
    for field in dataclasses.fields(cls):
        kind, meaning, read = hints[field.name].__origin__, hints[field.name].__metadata__[-1], types[field.name]
        below = "list below" if "a list" in read.expected else "below"
        is_optional = field.default is not dataclasses.MISSING and not field.default
        name = f"*`{field.name}`*" if is_optional else f"`{field.name}`"
        entry = f"- {name} ({below if _sections_in(kind) else _short(read.expected)}): {meaning}"
        yield from textwrap.wrap(entry, 120, subsequent_indent="  ", break_on_hyphens=False)
    yield ""


def _short(expected: str) -> str:
    """Return the value of a key in short words."""
    found = next((each for each in _SHORT if expected.startswith(each)), "")
    return _SHORT.get(found, "") + expected.removeprefix(found)


if __name__ == "__main__":
    PAGE.write_text(sidecar_page(), encoding="utf-8")
