"""The tables of the site's page of formats, made from the tables of statements of the readers."""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Iterator

import renderer.readers
from renderer.readers import FormatTable

_ARTICLE = re.compile("^(the|an?) ")


def format_tables() -> list[FormatTable]:
    """Return the tables of all readers, in the order of the names of formats."""
    names = [each.name for each in pkgutil.iter_modules(renderer.readers.__path__)]
    modules = (importlib.import_module(f"renderer.readers.{name}") for name in names)
    tables = [module.STATEMENTS for module in modules if hasattr(module, "STATEMENTS")]
    return sorted(tables, key=lambda table: table.format.lower())


def field_tables() -> Iterator[str]:
    """Yield the lines of a section for each format, in which the fields that are applied come first."""
    for table in format_tables():
        yield from (f"## {table.format}", "", "| Field | States | hsplat |", "|---|---|---|")
        for each in sorted(table.statements, key=lambda statement: not statement.is_applied):
            use = "applies it" if each.is_applied else "names it in a note"
            yield f"| `{each.field}` | {_ARTICLE.sub('', each.about)} | {use} |"
        yield ""
