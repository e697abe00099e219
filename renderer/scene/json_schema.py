"""The JSON Schema of mappings with keys, and examples of them, from the types of the keys and the texts on them."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from renderer.scene.message_text import format_value
from renderer.scene.tree_node import FieldTable, FieldType, JsonSchema

# Whole numbers below this are written without a point and an exponent.
_MAX_WHOLE = 1e15
# The words for how values move between two keys.
_MOTIONS = {"linear": "by equal amounts", "ratio": "in even ratios", "direction": "on the sphere"}
# A text that needs no quotes in YAML, where true, false and null are no texts.
_PLAIN_TEXT = re.compile(r"(?!(?:true|false|null)\Z)-?[a-z][\w./-]{0,60}", re.ASCII | re.IGNORECASE)


@dataclass(frozen=True)
class Alternatives:
    """The keys of a mapping that take the place of each other.

    one_of: groups of keys; at most one key of each group may be given. needed: groups of which one has to be given.
    """

    one_of: Collection[Collection[str]] = ()
    needed: Collection[Collection[str]] = ()


NO_ALTERNATIVES = Alternatives()


def mapping_schema(table: FieldTable, alternatives: Alternatives = NO_ALTERNATIVES, *, moves: bool) -> JsonSchema:
    """Return the JSON Schema of a mapping with some keys of `table`. moves: whether their values may move."""
    required = [key for key, field in table.items() if field.is_needed]
    keys: dict[str, list[str]] = {}
    for group in alternatives.one_of:
        for key in group:
            keys.setdefault(key, []).extend(other for other in group if other != key)
    shape: JsonSchema = {
        "type": "object",
        "properties": {key: key_schema(key, field, moves) for key, field in table.items()},
        "additionalProperties": False,
    }
    if required:
        shape["required"] = required
    if keys:
        shape["dependencies"] = {
            key: {"properties": dict.fromkeys(rest, False), "errorMessage": f"contradicts {key}: one of them"}
            for key, rest in keys.items()
        }
    if alternatives.needed:
        shape["allOf"] = [_one_needed([*group]) for group in alternatives.needed]
    return shape


def _one_needed(group: Sequence[str]) -> JsonSchema:
    """Return the JSON Schema of a mapping with one key of a group at least; else the first one is missing.

    `anyOf` alone would do, but editors show the descriptions of all its parts in place of the mapping's own.
    """
    given = {"anyOf": [{"required": [key]} for key in group]}
    return {"if": {"not": given}, "then": {"required": [group[0]]}}


def key_schema(key: str, field: FieldType[Any], moves: bool = True) -> JsonSchema:
    """Return the JSON Schema of a key's value, with the text on the key."""
    # This import is not at the top of the file, because reading a scene from plain data needs no YAML.
    from renderer.scene.yaml_tree import parse_yaml

    if field.text is None:
        return field.schema(moves)
    shape = {"title": key, "description": "\n".join(key_lines(field))} | field.schema(moves)
    if field.default is not None:
        # A default beside the title would be written into a scene with its section. In `allOf` it is only proposed.
        proposed = {"allOf": [*shape.get("allOf", []), {"default": field.default}]}
        # Editors write 0 for a number without an example.
        is_number = shape.get("type") in ("number", "integer")
        return shape | proposed | ({"examples": [field.default]} if is_number else {})
    example = parse_yaml(example_of(field)).data if example_of(field) else None
    return shape if example is None or _is_written_wrongly(example) else shape | {"examples": [example]}


def _is_written_wrongly(example: object) -> bool:
    """Return whether editors write an example wrongly.

    They write `[object Object]` for lists and mappings in a list, and texts in a mapping without their quotes.
    """
    if isinstance(example, Mapping):
        return any(isinstance(item, str) and not _PLAIN_TEXT.fullmatch(item) for item in example.values())
    return isinstance(example, list) and any(isinstance(item, (list, Mapping)) for item in example)


def key_lines(field: FieldType[Any]) -> list[str]:
    """Return the text on a key: its sentence, its values, its default, and whether it moves."""
    lines = [field.text.sentence if field.text else "", f"Value: {field.expected}."]
    words = field.text.default if field.text else ""
    default = words if field.default is None else yaml_flow(field.default)
    if field.is_needed or default:
        lines.append("Needed." if field.is_needed else f"Default: {default}.")
    if field.motion is not None:
        lines.append(f"Moves: a map from frames to values may take its place; they change {_MOTIONS[field.motion]}.")
    return lines


def mapping_example(table: FieldTable, alternatives: Alternatives = NO_ALTERNATIVES) -> str:
    """Return an example of a mapping, as YAML: its needed keys, the first of alternatives, and all defaults."""
    behind = {key for group in alternatives.one_of for key in [*group][1:]}
    first = {next(iter(group)) for group in alternatives.needed}
    chosen = [
        f"{key}: {example_of(field)}"
        for key, field in table.items()
        if key not in behind and (field.is_needed or key in first or field.default is not None)
    ]
    return f"{{{', '.join(chosen)}}}"


def example_of(field: FieldType[Any]) -> str:
    """Return an example of a key's value, as YAML: its default, the example in its text, or one of its type."""
    if field.default is not None:
        return yaml_flow(field.default)
    return (field.text.example if field.text else "") or field.example


def yaml_flow(value: object) -> str:
    """Return plain data as YAML on one line, with quotes around texts that need them."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{key}: {yaml_flow(item)}' for key, item in value.items())}}}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(yaml_flow, value))}]"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return value if _PLAIN_TEXT.fullmatch(value) else json.dumps(value, ensure_ascii=False)
    return format_value(value)


def as_written(value: object) -> object:
    """Return a default or a bound as plain data: numbers that are whole without a point."""
    if isinstance(value, tuple):
        return [as_written(each) for each in value]
    return int(value) if isinstance(value, float) and value.is_integer() and abs(value) < _MAX_WHOLE else value
