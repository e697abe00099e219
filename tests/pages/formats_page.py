"""The page docs/formats.md, made from the tables of statements: `python tests/pages/formats_page.py` writes it."""

from __future__ import annotations

import importlib
import pkgutil
import re
import textwrap
from pathlib import Path

import renderer.readers
from renderer.readers import FormatTable

PAGE = Path(__file__).resolve().parents[2] / "docs" / "formats.md"
_HEAD = """\
# Fields of volume files

Files state scales, directions, values that are no data, names of labels. hsplat applies the fields that are listed
first, and names the others in a note. `tests/pages/formats_page.py` makes this page from the tables of the readers.
"""
_LINE_LENGTH = 120
_ARTICLE = re.compile("^(the|an?) ")


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
    """Return the section of a format: a list of the fields that are applied, and a list of the others."""
    lines = [f"## {table.format}", ""]
    for title, is_applied in (("Applied", True), ("Named", False)):
        found = _by_meaning(table, is_applied=is_applied)
        if found:
            listed = ", ".join(f"{fields} ({about})" for about, fields in found.items())
            lines += [*textwrap.wrap(f"{title}: {listed}.", _LINE_LENGTH, break_on_hyphens=False), ""]
    return "\n".join(lines)


def _by_meaning(table: FormatTable, *, is_applied: bool) -> dict[str, str]:
    """Return the names of the fields that state the same, by the noun for it."""
    found: dict[str, list[str]] = {}
    for each in table.statements:
        if each.is_applied == is_applied:
            found.setdefault(_ARTICLE.sub("", each.about), []).append(f"`{each.field}`")
    return {about: ", ".join(fields) for about, fields in found.items()}


if __name__ == "__main__":
    PAGE.write_text(formats_page(), "utf-8")
