"""Check what a film of parts takes over from the sidecars of its parts; they may have been edited."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hsplat_cli.scenes import is_shallow, read_known_fields
from renderer.errors import Problem
from renderer.scene import (
    BOOLEAN_FIELD,
    MAPPING_FIELD,
    OUTPUT_FILE_FIELD,
    TEXT_FIELD,
    FieldTable,
    FieldType,
    TreeNode,
    format_value,
)

# No measured value comes near it, and sums over all parts stay finite.
_MAX_AMOUNT = 1e100
# More levels than any sidecar has that this program wrote.
_MAX_LEVELS = 20


def part_problems(data: Mapping[str, Any]) -> list[Problem]:
    """Return what is wrong with the content of a part's sidecar, besides what `parse_sidecar` checks."""
    if not is_shallow(data, _MAX_LEVELS):
        return [Problem("", "too many levels", expected=f"at most {_MAX_LEVELS}")]
    problems: list[Problem] = []
    _PART.read(TreeNode(data, "", problems))
    return problems


def _parse_amount(node: TreeNode) -> Any:
    """Check a number that is copied into the next sidecar, so text that spells a number is refused."""
    value: Any = node.value
    if type(value) not in (int, float):
        return _AMOUNT.reject(node, "not a number", got=format_value(value))
    return value if 0 <= value <= _MAX_AMOUNT else _AMOUNT.reject(node, "out of range")


_AMOUNT: FieldType[Any] = FieldType(f"a number from 0 to {_MAX_AMOUNT:g}", _parse_amount)


def _mapping(table: FieldTable, optional: str = "") -> FieldType[Any]:
    """Return the type of a mapping that has these keys, of which one is optional, and perhaps others."""
    required = [key for key in table if key != optional]
    return FieldType("a mapping", lambda node: read_known_fields(node, table, required=required))


def _all(kind: type[dict[Any, Any]] | type[list[Any]], expected: str, item: FieldType[Any]) -> FieldType[Any]:
    """Return the type of a mapping or a list of such items."""

    def parse(node: TreeNode) -> Any:
        value: Any = node.value
        if not isinstance(value, kind):
            return found.reject(node, f"not {expected}")
        for key, each in value.items() if isinstance(value, dict) else enumerate(value):
            item.read(node.child(key, each))
        return value

    found: FieldType[Any] = FieldType(expected, parse)
    return found


_SCHEDULE: FieldTable = {"met": BOOLEAN_FIELD, "reproducible": BOOLEAN_FIELD, "shortfall": TEXT_FIELD}
_PART = _mapping(
    {
        "scene": _mapping(
            {
                "output": _mapping({"file": OUTPUT_FILE_FIELD}),
                "camera": _mapping({"path": _mapping({"frames": _AMOUNT})}),
                "error": MAPPING_FIELD,
            }
        ),
        "camera": MAPPING_FIELD,
        "pyramid": _mapping({"finest_level_drawn": _AMOUNT}),
        "gl": TEXT_FIELD,
        "versions": _all(dict, "a mapping", TEXT_FIELD),
        "schedule": _mapping(_SCHEDULE, optional="shortfall"),
        "notes": _all(list, "a list", TEXT_FIELD),
        "seconds": _all(dict, "a mapping", _AMOUNT),
    }
)
