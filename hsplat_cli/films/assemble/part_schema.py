"""Check what a film of parts takes over from the sidecars of its parts; they may have been edited."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any

from hsplat_cli.scenes import is_shallow
from renderer.errors import Problem
from renderer.scene import BOOLEAN_FIELD, TEXT_FIELD, FieldTable, FieldType, TreeNode, format_value

# No measured value comes near it, and sums over all parts stay finite.
_MAX_AMOUNT = 1e100
# More levels than any sidecar has that this program wrote.
_MAX_LEVELS = 20


def part_problems(data: Mapping[str, Any]) -> list[Problem]:
    """Return what is wrong with the content of a part's sidecar, besides what `parse_sidecar` checks."""
    if not is_shallow(data, _MAX_LEVELS):
        return [Problem("", "too many levels", expected=f"at most {_MAX_LEVELS}")]
    problems: list[Problem] = []
    _PART_SCHEMA.parse(TreeNode(data, "", problems))
    return problems


def _parse_amount(node: TreeNode) -> Any:
    """Check a number that is copied into the next sidecar, so text that spells a number is refused."""
    value: Any = node.value
    if type(value) not in (int, float):
        return _AMOUNT.reject(node, "not a number", got=format_value(value))
    return value if 0 <= value <= _MAX_AMOUNT else _AMOUNT.reject(node, "out of range")


_AMOUNT: FieldType[Any] = FieldType(f"a number from 0 to {_MAX_AMOUNT:g}", _parse_amount)
# The PSNR of equal pictures is null.
_WORST: FieldType[Any] = FieldType(_AMOUNT.expected, lambda node: None if node.value is None else _AMOUNT.parse(node))


def _container(expected: str, kind: type, parse_items: Callable[[TreeNode, Any], object]) -> FieldType[Any]:
    def parse(node: TreeNode) -> Any:
        if not isinstance(node.value, kind):
            return found.reject(node, f"not {expected}")
        parse_items(node, node.value)
        return node.value

    found: FieldType[Any] = FieldType(expected, parse)
    return found


def _mapping(table: FieldTable, optional: Collection[str] = ()) -> FieldType[Any]:
    """Return the kind of a mapping that has these keys, and perhaps others."""

    def parse_items(node: TreeNode, value: Any) -> None:
        for key, kind in table.items():
            if key in value:
                kind.parse(node.child(key, value[key]))
            elif key not in optional:
                kind.reject(node.child(key), "missing")

    return _container("a mapping", dict, parse_items)


def _parse_all(item: FieldType[Any], node: TreeNode, items: Iterable[tuple[Any, Any]]) -> None:
    for key, value in items:
        item.parse(node.child(key, value))


def _mapping_of(item: FieldType[Any]) -> FieldType[Any]:
    return _container("a mapping", dict, lambda node, value: _parse_all(item, node, value.items()))


def _list_of(item: FieldType[Any]) -> FieldType[Any]:
    return _container("a list", list, lambda node, value: _parse_all(item, node, enumerate(value)))


_SCHEDULE: FieldTable = {
    "met": BOOLEAN_FIELD,
    "reproducible": BOOLEAN_FIELD,
    "measured": _mapping({"metric": TEXT_FIELD, "worst": _WORST, "probes": _list_of(_AMOUNT)}),
    "shortfall": TEXT_FIELD,
}

_PART_SCHEMA = _mapping(
    {
        "scene": _mapping({"error": _mapping({})}),
        "camera": _mapping({}),
        "pyramid": _mapping({"finest_level_drawn": _AMOUNT}),
        "gl": TEXT_FIELD,
        "versions": _mapping_of(TEXT_FIELD),
        "schedule": _mapping(_SCHEDULE, optional=["measured", "shortfall"]),
        "notes": _list_of(TEXT_FIELD),
        "seconds": _mapping_of(_AMOUNT),
    }
)
