"""Field types that turn plain data (mappings, lists, scalars) into checked values and find every mistake at once.

A `FieldType` says what is expected and reads it from a `TreeNode`, a value with its path. For a mistake it adds a
problem to the node's list and returns INVALID, so that reading continues; the caller discards the result if there is
any problem. INVALID equals no legal value and has none of their types, so checks of several values skip values that are
already wrong.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import MISSING, fields, is_dataclass, replace
from functools import partial
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeGuard, TypeVar, get_args, get_origin, get_type_hints

from renderer.errors import Problem, closest_match
from renderer.scene.json_schema import (
    NO_ALTERNATIVES as NO_ALTERNATIVES,
    Alternatives as Alternatives,
    as_written,
    example_of as example_of,
    key_lines as key_lines,
    key_schema as key_schema,
    mapping_example as mapping_example,
    mapping_schema as mapping_schema,
    yaml_flow as yaml_flow,
)
from renderer.scene.message_text import did_you_mean, format_value, join_words
from renderer.scene.motion import MotionKind, is_plain
from renderer.scene.tree_node import (
    INVALID as INVALID,
    MAX_FRAMES as MAX_FRAMES,
    FieldTable as FieldTable,
    FieldType as FieldType,
    FilmTime as FilmTime,
    JsonSchema as JsonSchema,
    KeyText as KeyText,
    TreeNode as TreeNode,
    any_of as any_of,
    check_frame_in_path as check_frame_in_path,
    check_frames_ascend as check_frames_ascend,
    either as either,
    read_frame as read_frame,
    still as still,
)
from renderer.system import number_in

T = TypeVar("T")

Vector = tuple[float, float, float]
Color = tuple[float, float, float]

# The shortest spacing or length in a scene: an atom in light years is longer. Squares, cubes and products of lengths
# from MIN_WORLD_LENGTH to MAX_WORLD_LENGTH are far from float64's limits.
MIN_WORLD_LENGTH = 1e-30
# The longest spacing or length in a scene: the universe in picometres is shorter.
MAX_WORLD_LENGTH = 1e30


_DECIMAL_COMMA = re.compile(r"[-+]?\d{1,20},\d{1,20}", re.ASCII)

TILDE_HINT = "~ is not expanded: write the whole path"


def is_file_name(value: object) -> TypeGuard[str]:
    """Return whether a value is a text that can name a file on this system. No file name has half a surrogate pair."""
    try:
        return isinstance(value, str) and bool(value.strip()) and b"\0" not in os.fsencode(value)
    except UnicodeEncodeError:
        return False


def has_unexpanded_tilde(name: str) -> bool:
    """Return whether a name begins with a `~` that only a shell expands to a home folder."""
    return name == "~" or name.startswith("~/")


# Types of scalars: numbers, text, words


def number_field(
    *,
    minimum: float = -math.inf,
    maximum: float = math.inf,
    above: float = -math.inf,
    zero_hint: str | None = None,
    is_whole: bool = False,
    motion: MotionKind | None = "linear",
) -> FieldType[Any]:
    """Return the type of a finite number from `minimum` to `maximum` that is greater than `above`.

    Text that spells a number is taken as a number, because YAML 1.1 reads `1e-3` as text.
    zero_hint: the hint for a 0 that is out of range.
    is_whole: whether only whole numbers are allowed, such as 120, `1e3` and `120.0`.
    motion: how numbers move between two keys; None if they cannot move.
    """
    noun = "whole number" if is_whole else "number"

    def parse(node: TreeNode) -> Any:
        value = parse_whole_number(node.value) if is_whole else _as_float(node.value)
        if value is None:
            return node.reject(f"not a {noun}", hint=_decimal_point_hint(node.value))
        if isinstance(value, float) and not math.isfinite(value):
            return node.reject("not a finite number")
        if minimum <= value <= maximum and value > above:
            return value
        return node.reject("out of range", hint=zero_hint if value == 0 else None)

    bounds = {"minimum": minimum, "exclusiveMinimum": above, "maximum": maximum}
    shape: JsonSchema = {"type": "integer" if is_whole else "number"}
    shape |= {name: as_written(bound) for name, bound in bounds.items() if math.isfinite(bound)}
    expected = f"a {noun}{_range_words(minimum, above, maximum)}"
    return FieldType(expected, parse, motion=motion, plain_schema=lambda _moves: shape)


integer_field = partial(number_field, is_whole=True, motion=None)


def _range_words(minimum: float, above: float, maximum: float) -> str:
    if math.isfinite(minimum) and math.isfinite(maximum):
        return f" from {format_value(minimum)} to {format_value(maximum)}"
    parts = {"of at least": minimum, "greater than": above, "at most": maximum}
    words = [f"{word} {format_value(bound)}" for word, bound in parts.items() if math.isfinite(bound)]
    return f" {join_words(words, 'and')}" if words else ""


def _decimal_point_hint(value: object) -> str | None:
    """Return a hint for a number with a decimal comma."""
    if not isinstance(value, str) or not _DECIMAL_COMMA.fullmatch(value):
        return None
    return f"decimals come after a point: {value.replace(',', '.')}"


def _as_float(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    if isinstance(value, str):
        number = number_in(value)
        return None if math.isnan(number) else number
    try:
        return float(value)
    except OverflowError:
        return math.inf


def parse_whole_number(value: object) -> int | None:
    """Return the whole number that a value is or, as text, spells; None for any other value."""
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    as_float = _as_float(value)
    return int(as_float) if as_float is not None and as_float.is_integer() else None


FRAME_NUMBER_FIELD = integer_field(minimum=0, maximum=MAX_FRAMES - 1)
LENGTH_FIELD = number_field(minimum=MIN_WORLD_LENGTH, maximum=MAX_WORLD_LENGTH, motion="ratio")
COORDINATE_FIELD = number_field(minimum=-MAX_WORLD_LENGTH, maximum=MAX_WORLD_LENGTH)


def of_json_type(name: str) -> Callable[[bool], JsonSchema]:
    """Return the `plain_schema` of all values of one type of JSON, such as `string`."""
    return lambda _moves: {"type": name}


def _instance_field(cls: type[T], expected: str, what: str, json_type: str) -> FieldType[T]:
    def parse(node: TreeNode) -> Any:
        return node.value if isinstance(node.value, cls) else node.reject(what)

    return FieldType(expected, parse, plain_schema=of_json_type(json_type))


BOOLEAN_FIELD = _instance_field(bool, "true or false", "not true or false", "boolean")
TEXT_FIELD = _instance_field(str, "text", "not text", "string")
MAPPING_FIELD: FieldType[dict[str, Any]] = _instance_field(dict, "a mapping", "not a mapping", "object")


def text_field(expected: str, what: str, is_valid: Callable[[str], object]) -> FieldType[Any]:
    """Return the type of a text that `is_valid` accepts. what: the message about any other text."""

    def parse(node: TreeNode) -> Any:
        return node.value if isinstance(node.value, str) and is_valid(node.value) else node.reject(what)

    return FieldType(expected, parse, plain_schema=of_json_type("string"))


def choice_field(*names: str, aliases: Mapping[str, str] | None = None) -> FieldType[Any]:
    """Return the type of a text that is one of `names`. aliases: other programs' words for these names, for hints."""

    def parse(node: TreeNode) -> Any:
        if not isinstance(node.value, str):
            return node.reject("unknown value")
        if node.value in names:
            return node.value
        word = node.value.lower()
        meant = (aliases or {}).get(word)
        return node.reject("unknown value", hint=f"did you mean {meant}?" if meant else did_you_mean(word, names))

    return FieldType(join_words(names), parse, plain_schema=lambda _moves: {"enum": [*names]}, example=names[0])


def word_or(words: Mapping[str, Any], other: FieldType[Any], expected: str) -> FieldType[Any]:
    """Return the type of a value that is written as one of some words, or as a value of the type `other`.

    words: the words, each with the value that it stands for.
    """

    def parse(node: TreeNode) -> Any:
        if isinstance(node.value, str) and node.value in words:
            return words[node.value]
        return other.parser(replace(node, words=words))

    return replace(
        other,
        expected=expected,
        parser=parse,
        table=None,
        plain_schema=lambda moves: any_of({"enum": [*words]}, other.plain_schema(moves)),
        words={**words, **other.words},
    )


# Types of lists and mappings


def sequence_field(
    item: FieldType[Any],
    expected: str,
    *,
    count: int | None = None,
    may_be_empty: bool = False,
    check: Callable[[TreeNode, tuple[Any, ...]], Any] | None = None,
    motion: MotionKind | None = None,
) -> FieldType[Any]:
    """Return the type of a list of items of one type. A wrong item becomes INVALID.

    count: the number of items; None for one item or more, or none if the list `may_be_empty`.
    check: a function that returns the items, or INVALID. It is called if every item is right and none moves; items that
        move are checked at their keys.
    motion: how the list moves between two keys; by default, as its items do.
    """

    def parse(node: TreeNode) -> Any:
        if not isinstance(node.value, (list, tuple)):
            return node.reject("unknown value" if node.words and isinstance(node.value, str) else "not a list")
        if len(node.value) != count if count else not (node.value or may_be_empty):
            return node.reject("wrong number of items")
        items = tuple(item.read(node.child(index, value)) for index, value in enumerate(node.value))
        return items if check is None or INVALID in items or not is_plain(items) else check(node, items)

    lengths = {"minItems": count or (0 if may_be_empty else 1)} | ({"maxItems": count} if count else {})
    return FieldType(
        expected,
        parse,
        motion=motion or (item.motion and "linear"),
        table=item.table,
        plain_schema=lambda moves: {"type": "array", "items": item.schema(moves), **lengths},
        example=f"[{item.example}]" if item.example and not count else "",
    )


POINT_FIELD = sequence_field(COORDINATE_FIELD, "[x, y, z] in world units", count=3)


def pair_field(first: FieldType[Any], second: FieldType[Any], expected: str) -> FieldType[Any]:
    """Return the type of a list of two items. first, second: the types of the items."""

    def parse(node: TreeNode) -> Any:
        if not isinstance(node.value, (list, tuple)) or len(node.value) != 2:
            return node.reject("not a pair")
        return first.read(node.child(0, node.value[0])), second.read(node.child(1, node.value[1]))

    def shape(moves: bool) -> JsonSchema:
        return {"type": "array", "items": [first.schema(moves), second.schema(moves)], "minItems": 2, "maxItems": 2}

    return FieldType(expected, parse, motion=first.motion, plain_schema=shape)


def mapping_field(item: FieldType[T], expected: str = "a mapping", key_name: str = "text") -> FieldType[dict[str, T]]:
    """Return the type of a mapping from any texts to items of one type. A wrong item becomes INVALID.

    key_name: the words of messages for a key that is no text.
    """

    def parse(node: TreeNode) -> Any:
        if not isinstance(node.value, Mapping):
            return node.reject("not a mapping")
        for key in node.value:
            if not isinstance(key, str):
                node.key(key, key).reject(f"not {key_name}", expected="text", hint="put it in quotes")
        return {key: item.read(node.child(key, value)) for key, value in node.value.items()}

    return FieldType(expected, parse)


def section_field(
    table: FieldTable,
    build: Callable[[TreeNode, dict[str, Any]], T],
    *,
    required: Collection[str] = (),
    misplaced_hints: Mapping[str, str] | None = None,
    alternatives: Alternatives = NO_ALTERNATIVES,
) -> FieldType[T]:
    """Return the type of a mapping with the keys of `table`.

    build: a function that checks the given values together, and makes the result of them.
    misplaced_hints: hints for keys that belong in another place.
    alternatives: the keys of which one alone is given. `build` reports several of them.
    """

    def read(node: TreeNode) -> T:
        return build(node, read_fields(node, table, required=required, misplaced_hints=misplaced_hints))

    table = {key: replace(field, is_needed=key in required) for key, field in table.items()}
    return FieldType(
        _mapping_with(table, required),
        read,
        table=table,
        plain_schema=lambda moves: mapping_schema(table, alternatives, moves=moves),
        example=mapping_example(table, alternatives),
    )


def dataclass_field(
    cls: Callable[..., T],
    check: Callable[[TreeNode, dict[str, Any]], object] | None = None,
    alternatives: Alternatives = NO_ALTERNATIVES,
) -> FieldType[T]:
    """Return the type of a mapping whose keys are the fields of a dataclass. It is read as an instance of the class.

    check: a function that compares the given values with each other, and adds problems.
    alternatives: the keys of which one alone is given. `check` reports several of them.
    """

    def build(node: TreeNode, given: dict[str, Any]) -> T:
        if check is not None:
            check(node, given)
        return cls(**given)

    return section_field(field_table(cls), build, required=required_keys(cls), alternatives=alternatives)


def field_table(cls: Any) -> dict[str, FieldType[Any]]:
    """Return the types of a dataclass's fields, as annotations declare them, or as they follow from type hints.

    Fields whose type hints do not determine a field type are left out. A `KeyText` among the annotations is the text on
    the key, and the field's default is the key's.
    """
    hints = get_type_hints(cls, include_extras=True)
    found = {each.name: (_field_type(hints[each.name]), each.default) for each in fields(cls)}
    return {
        name: replace(field, text=_key_text(hints[name]), default=_default(field, default))
        for name, (field, default) in found.items()
        if field is not None
    }


def described(
    field: FieldType[T], sentence: str, *, default: object = None, words: str = "", example: str = ""
) -> FieldType[T]:
    """Return the type of a key's value with the text on the key.

    default: the key's default; None for none. words, example: as `default` and `example` of KeyText.
    """
    return replace(field, text=KeyText(sentence, words, example), default=as_written(default))


def _key_text(hint: Any) -> KeyText | None:
    texts = (item for item in getattr(hint, "__metadata__", ()) if isinstance(item, KeyText))
    return next(texts, None)


def _default(field: FieldType[Any], value: object) -> object:
    """Return the default of a key as a scene has it, from the default of the dataclass; None for no default."""
    if value is MISSING:
        return None
    words = (word for word, meant in field.words.items() if meant == value)
    return next(words, as_written(value))


def _field_type(hint: Any) -> FieldType[Any] | None:
    """Return the field type that a type hint has as an annotation, or that follows from the hint; None if none does.

    It follows for a boolean, text, one of a Literal's words, another dataclass, or a list of any number of these.
    """
    if get_origin(hint) is Annotated:
        declared = (item for item in hint.__metadata__ if isinstance(item, FieldType))
        return next(declared, None) or _field_type(hint.__origin__)
    if get_origin(hint) is Literal:
        return choice_field(*get_args(hint))
    if get_origin(hint) is UnionType:
        kinds = [kind for kind in get_args(hint) if kind is not NoneType]
        return _field_type(kinds[0]) if len(kinds) == 1 else None
    if get_origin(hint) is tuple and get_args(hint)[1:] == (...,):
        item = _field_type(get_args(hint)[0])
        return item and sequence_field(item, "a list", may_be_empty=True)
    if isinstance(hint, type) and is_dataclass(hint):
        return dataclass_field(hint)
    plain: dict[Any, FieldType[Any]] = {bool: BOOLEAN_FIELD, str: TEXT_FIELD}
    return plain.get(hint)


def required_keys(cls: Any) -> list[str]:
    """Return the names of a dataclass's fields that have no default."""
    return [each.name for each in fields(cls) if each.default is MISSING and each.default_factory is MISSING]


def _mapping_with(table: FieldTable, required: Collection[str]) -> str:
    return f"a mapping with {join_words(required, 'and') if required else join_words(table)}"


def read_fields(
    node: TreeNode,
    table: FieldTable,
    *,
    required: Collection[str] = (),
    misplaced_hints: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """Return the values of a mapping's known keys, and add problems for unknown and missing keys.

    Optional keys that are not given are not in the result, so that the dataclass supplies their defaults.
    misplaced_hints: hints for keys that belong in another place.
    """
    if not isinstance(node.value, Mapping):
        node.reject("not a mapping", got=format_value(node.value), expected=_mapping_with(table, required))
        return dict.fromkeys(table, INVALID)
    given: dict[str, Any] = {}
    for key, value in node.value.items():
        if key in table:
            given[key] = table[key].read(node.child(key, value))
            continue
        close = closest_match(key, table) if isinstance(key, str) else None
        other_place = (misplaced_hints or {}).get(key) if isinstance(key, str) else None
        hint = other_place or (f"did you mean {close}?" if close else None)
        if value is None and type(key) is int:  # YAML reads {opacity: 0,5} as a key `opacity` and a key 5
            hint = "decimals come after a point; in {...} and [...] a comma begins what comes next"
        node.key(key).reject("unknown key", expected=join_words(table), hint=hint)
        if close and close not in node.value:  # a misspelt key is not also reported as missing
            given[close] = INVALID
    for key in required:
        if key not in given:
            table[key].reject(node.child(key), "missing")
            given[key] = INVALID
    return given


def read_option(
    field: FieldType[T], value: object, location: str, problems: list[Problem], film: FilmTime | None = None
) -> T:
    """Return the value that a field type reads from a value outside of a scene, such as an option.

    Its problems are added to `problems`, with `location` as their place.
    """
    found: list[Problem] = []
    result = field.read(TreeNode(value, "", found, film=film))
    problems += [replace(problem, location=location) for problem in found]
    return result


def valid_keys(given: Mapping[str, Any], *keys: str) -> list[str]:
    """Return the keys among `keys` that were given and read without a problem."""
    return [key for key in keys if given.get(key, INVALID) is not INVALID]
