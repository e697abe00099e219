"""What a part's sidecar tells besides its frames, and the film's takes over: it may have been changed by hand."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from hsplat_cli.scenes import is_shallow
from renderer.errors import Problem
from renderer.scene import BOOLEAN_FIELD, TEXT_FIELD, FieldTable, FieldType, TreeNode

# Nothing that is measured comes near it, and sums over all parts stay finite.
_MOST = 1e100
# More than any sidecar has that was written by this program.
_MOST_LEVELS = 20


def part_problems(data: Mapping[str, Any]) -> list[Problem]:
    """What is wrong with the content of a part's sidecar besides what `parse_sidecar` sees.

    Keys may be missing, for older sidecars have fewer, but for those that every scene has.
    """
    if not is_shallow(data, _MOST_LEVELS):
        return [Problem("", "too many levels", expected=f"at most {_MOST_LEVELS}")]
    problems: list[Problem] = []
    _PART_SCHEMA.parse(TreeNode(data, "", problems))
    return problems


def _parse_amount(node: TreeNode) -> Any:
    """Taken over as it stands, so that text that spells a number is none."""
    value: Any = node.value
    if type(value) not in (int, float):
        return _AMOUNT.reject(node, "not a number")
    return value if 0 <= value <= _MOST else _AMOUNT.reject(node, "out of range")


_AMOUNT = FieldType(f"a number from 0 to {_MOST:g}", _parse_amount)
# The PSNR of equal pictures is told as null.
_WORST = FieldType(_AMOUNT.expected, lambda node: None if node.value is None else _AMOUNT.parse(node))


def _mapping(table: FieldTable, required: Collection[str] = ()) -> FieldType[Any]:
    """A mapping in which these keys, where they are, have values of these kinds; there may be others."""

    def parse(node: TreeNode) -> Any:
        if not isinstance(node.value, dict):
            return kind.reject(node, "not a mapping")
        for key, each in table.items():
            if key in node.value:
                each.parse(node.child(key, node.value[key]))
            elif key in required:
                each.reject(node.child(key), "missing")
        return node.value

    kind: FieldType[Any] = FieldType("a mapping", parse)
    return kind


def _mapping_of(item: FieldType[Any]) -> FieldType[Any]:
    """A mapping whose values are all of a kind."""

    def parse(node: TreeNode) -> Any:
        if not isinstance(node.value, dict):
            return kind.reject(node, "not a mapping")
        return {key: item.parse(node.child(key, value)) for key, value in node.value.items()}

    kind: FieldType[Any] = FieldType("a mapping", parse)
    return kind


def _list_of(item: FieldType[Any]) -> FieldType[Any]:
    """A list of any length."""

    def parse(node: TreeNode) -> Any:
        if not isinstance(node.value, list):
            return kind.reject(node, "not a list")
        return [item.parse(node.child(index, value)) for index, value in enumerate(node.value)]

    kind: FieldType[Any] = FieldType("a list", parse)
    return kind


_MEASURED = _mapping({"metric": TEXT_FIELD, "worst": _WORST, "probes": _list_of(_AMOUNT)})

_PART_SCHEMA = _mapping(
    {
        "scene": _mapping({"error": _mapping({})}, required=["error"]),
        "pyramid": _mapping({"finest_level_drawn": _AMOUNT}),
        "versions": _mapping_of(TEXT_FIELD),
        "schedule": _mapping(
            {"met": BOOLEAN_FIELD, "reproducible": BOOLEAN_FIELD, "measured": _MEASURED, "shortfall": TEXT_FIELD}
        ),
        "notes": _list_of(TEXT_FIELD),
        "seconds": _mapping_of(_AMOUNT),
    }
)
