"""Say what each key of a scene is: for editors as one JSON Schema, for people as a few lines of text."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator
from typing import Any

from renderer.errors import InputError, closest_match
from renderer.scene import schema
from renderer.scene.message_text import join_words
from renderer.scene.schema import FieldTable, FieldType, JsonSchema
from renderer.scene.spec import SECTION_ALTERNATIVES, SECTIONS

# The comment in a JSON Schema by hsplat, which tells its file from others.
SCHEMA_COMMENT = "the keys of hsplat's scenes; `hsplat schema` writes this file"
# The name of a whole scene, by which editors offer all needed keys at once.
_TITLE = "scene"
# A part of the schema that is at least this long, in characters, and stands at several places is a definition.
_MIN_SHARED = 200
# The parts of a JSON Schema that hold schemas: by key, in lists, alone.
_BY_KEY = ("properties", "patternProperties", "dependencies")
_LISTS = ("anyOf", "allOf", "items")
_SINGLE = ("items", "additionalProperties")
# The largest number of keys that a message names as near to a wrong one.
_MAX_NEAR = 3


def scene_schema() -> JsonSchema:
    """Return the JSON Schema (draft 7) of a scene file, as plain data."""
    shape = schema.mapping_schema(SECTIONS, SECTION_ALTERNATIVES, moves=True)
    head = {"$schema": "http://json-schema.org/draft-07/schema#", "$comment": SCHEMA_COMMENT, "title": _TITLE}
    return head | _with_definitions(shape)


def scene_keys() -> Iterator[tuple[str, FieldType[Any]]]:
    """Yield each key of a scene by its dotted path, with the type of its value; list items have no number."""
    yield from _keys_below("", SECTIONS)


def _keys_below(path: str, table: FieldTable) -> Iterator[tuple[str, FieldType[Any]]]:
    for key, field in table.items():
        yield path + key, field
        yield from _keys_below(f"{path}{key}.", field.table or {})


def explain_key(key: str) -> list[str]:
    """Return the lines that explain a key of a scene, or the whole scene for an empty text.

    Raises InputError for an unknown key, with the names of keys that are near.
    """
    if not key:
        return [f"{name}: {_sentence(field)}" for name, field in SECTIONS.items()]
    path = ".".join(part for part in key.split(".") if not part.isdecimal())
    field = dict(scene_keys()).get(path)
    if field is None:
        near = _near_keys(path)
        hint = f"did you mean {join_words(near)}?" if near else None
        raise InputError("a scene has no such key", got=key, expected="a key such as light.key.radius", hint=hint)
    first, *others = schema.key_lines(field)
    lines = [f"{path}: {first}", *(f"  {line}" for line in others)]
    if field.default is None and (example := schema.example_of(field)):
        lines.append(f"  Example: {path.rpartition('.')[2]}: {example}")
    return lines + [f"  {path}.{name}: {_sentence(item)}" for name, item in (field.table or {}).items()]


def _sentence(field: FieldType[Any]) -> str:
    return field.text.sentence if field.text else ""


def _near_keys(path: str) -> list[str]:
    """Return the keys that end as a wrong key does, or else the one that is spelled most like it."""
    known = [key for key, _ in scene_keys()]
    parent, _, last = path.rpartition(".")
    same_end = [key for key in known if key.rpartition(".")[2] == last]
    if same_end:
        return sorted(same_end, key=len)[:_MAX_NEAR]
    beside = [key for key in known if key.rpartition(".")[0] == parent]
    close = closest_match(path, beside) or closest_match(path, known)
    return [close] if close else []


def _with_definitions(shape: JsonSchema) -> JsonSchema:
    """Return a JSON Schema in which schemas that stand at several places are definitions."""
    texts = Counter(json.dumps(part) for part in _schemas(shape))
    names: dict[str, str] = {}
    definitions: dict[str, JsonSchema] = {}

    def shared(part: Any, key: str) -> Any:
        text = json.dumps(part)
        if not isinstance(part, dict) or texts[text] < 2 or len(text) < _MIN_SHARED:
            return _map_schemas(part, shared, key)
        if text not in names:
            same = sum(each.partition("-")[0] == key for each in names.values())
            name = names[text] = f"{key}-{same + 1}" if same else key
            definitions[name] = _map_schemas(part, shared, key)
        return {"$ref": f"#/definitions/{names[text]}"}

    whole: JsonSchema = _map_schemas(shape, shared, "")
    return whole | {"definitions": definitions}


def _schemas(part: Any) -> Iterator[JsonSchema]:
    """Yield a schema and all schemas inside of it."""
    found: list[Any] = [part]
    while found:
        part = found.pop()
        yield part
        _map_schemas(part, lambda each, _: found.append(each), "")


def _map_schemas(part: Any, function: Callable[[Any, str], Any], key: str) -> Any:
    """Return a schema in which the results of a function stand in place of the schemas directly inside of it.

    function: it takes a schema, and the key whose value the schema describes. key: the key of the whole schema.
    """
    made = dict(part) if isinstance(part, dict) else part
    for name, item in part.items() if isinstance(part, dict) else ():
        if name in _BY_KEY:
            made[name] = {each: function(inner, each if name == "properties" else key) for each, inner in item.items()}
        elif name in _LISTS and isinstance(item, list):
            made[name] = [function(inner, key) for inner in item]
        elif name in _SINGLE:
            made[name] = function(item, key)
    return made
