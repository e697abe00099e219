"""The page docs/formats.md, made from the tables of statements: `python tests/support/formats_page.py` writes it."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

import renderer.readers
from renderer.readers.statements import FormatTable

PAGE = Path(__file__).resolve().parents[2] / "docs" / "formats.md"
_HEAD = """\
# What files say of their voxels

Beside numbers, files state how these are to be understood: a scale, a direction, values that are no data, the names of
labels. hsplat applies what it can and names the rest in a note, by the name that the field has in the standard of its
format. These tables are made from those of the readers by `tests/support/formats_page.py`.
"""


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
    rows = [
        f"| `{each.field}` | {each.about} | {each.effect} | {'applied' if each.is_applied else 'named in a note'} |"
        for each in table.statements
    ]
    return "\n".join([f"## {table.format}", "", "| field | it states | it changes | |", "|---|---|---|---|", *rows, ""])


if __name__ == "__main__":
    PAGE.write_text(formats_page(), "utf-8")
