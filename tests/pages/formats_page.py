"""The page docs/formats.md, made from the tables of statements: `python tests/pages/formats_page.py` writes it."""

from __future__ import annotations

import importlib
import pkgutil
import textwrap
from pathlib import Path

import renderer.readers
from renderer.readers import FormatTable

PAGE = Path(__file__).resolve().parents[2] / "docs" / "formats.md"
_HEAD = """\
# What files say of their voxels

Beside numbers, files state how these are to be understood: a scale, a direction, values that are no data, the names of
labels. Of each format hsplat applies the fields that are listed first, and names those of the table in a note, as the
standard of the format does. `tests/pages/formats_page.py` makes this page from the tables of the readers.
"""
_LINE_LENGTH = 120


def format_tables() -> list[FormatTable]:
    """Return the tables of all readers, in the order of the names of formats."""
    names = [each.name for each in pkgutil.iter_modules(renderer.readers.__path__)]
    modules = (importlib.import_module(f"renderer.readers.{name}") for name in names)
    tables = [module.STATEMENTS for module in modules if hasattr(module, "STATEMENTS")]
    return sorted(tables, key=lambda table: table.format.lower())


def formats_page() -> str:
    """Return the content of docs/formats.md."""
    return "\n".join([_HEAD, *map(_section, format_tables())])


def _section(table: FormatTable) -> str:
    """Return the section of a format: a list of the fields that are applied, and a table of the others."""
    applied, named = (_by_meaning(table, is_applied=is_applied) for is_applied in (True, False))
    listed = ", ".join(f"{fields} ({about})" for about, fields in applied.items())
    lines = [f"## {table.format}", "", *textwrap.wrap(f"{listed}.", _LINE_LENGTH, break_on_hyphens=False), ""]
    if named:
        rows = [f"| {fields} | {about} |" for about, fields in named.items()]
        lines += ["| named | states |", "|---|---|", *rows, ""]
    return "\n".join(lines)


def _by_meaning(table: FormatTable, *, is_applied: bool) -> dict[str, str]:
    """Return the names of the fields that state the same, by the noun phrase for it."""
    found: dict[str, list[str]] = {}
    for each in table.statements:
        if each.is_applied == is_applied:
            found.setdefault(each.about, []).append(f"`{each.field}`")
    return {about: ", ".join(fields) for about, fields in found.items()}


if __name__ == "__main__":
    PAGE.write_text(formats_page(), "utf-8")
