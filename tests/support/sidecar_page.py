"""The keys in docs/sidecar.md, made from the records of a film: `python tests/support/sidecar_page.py` writes them."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_type_hints

from renderer.record import SIDECAR, FilmRecord
from renderer.scene import schema

PAGE = Path(__file__).resolve().parents[2] / "docs" / "sidecar.md"
_HEAD = """\
## Keys

This section is made from `renderer/record/film_record.py` by `tests/support/sidecar_page.py`. A key in italics may be
left out.
"""


def sidecar_page() -> str:
    """Return the content of docs/sidecar.md: its text, with the tables of keys as the last section."""
    text, _, _ = PAGE.read_text("utf-8").partition(_HEAD.splitlines()[0] + "\n")
    return "\n".join([text + _HEAD, *("\n".join(_table(cls, paths)) for cls, paths in _records().items())])


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


def _table(cls: Any, paths: list[str]) -> Iterator[str]:
    yield f"### {' and '.join(paths) or 'The file'}"
    yield ""
    yield "| key | value | meaning |"
    yield "|---|---|---|"
    if cls is FilmRecord:
        yield f"| `format` | {SIDECAR.format_line} | The version of this format. |"
    hints, types = get_type_hints(cls, include_extras=True), schema.field_table(cls)
    for field in dataclasses.fields(cls):
        kind, meaning, read = hints[field.name].__origin__, hints[field.name].__metadata__[-1], types[field.name]
        value = ("a list of mappings" if "a list" in read.expected else "a mapping") + ", see below"
        is_optional = field.default is not dataclasses.MISSING and not field.default
        name = f"*`{field.name}`*" if is_optional else f"`{field.name}`"
        yield f"| {name} | {value if _sections_in(kind) else read.expected} | {meaning} |"
    yield ""


if __name__ == "__main__":
    PAGE.write_text(sidecar_page(), encoding="utf-8")
