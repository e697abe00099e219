"""A small toolkit that turns plain data (mappings, lists, scalars) into checked values and finds every mistake at once.

A `Kind` says what is expected and reads it from a `Node`, which is a value together with its place in the tree. A kind
that meets a mistake notes it in the node's list of problems and returns INVALID, which stands in for the value so that
reading goes on; whoever started the reading throws the result away if there is any problem. INVALID compares unequal to
every legal value and is an instance of none of their types, so a check of several values together stays quiet about
those that are already known to be wrong.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from renderer.errors import Problem, closest_match
from renderer.scene.spec import MAX_WORLD_LENGTH, MIN_WORLD_LENGTH

T = TypeVar("T")


class _Invalid:
    def __repr__(self) -> str:
        return "INVALID"


INVALID: Any = _Invalid()

_NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d{1,9})?", re.ASCII)
_DECIMAL_COMMA = re.compile(r"[-+]?\d{1,20},\d{1,20}", re.ASCII)
_MAX_SHOWN = 60
_MAX_KEY = 255  # as long as the name of a file can be


def join(path: str, key: object) -> str:
    """The dotted path of what lies at `key` (a mapping's key or a list's index) below `path`."""
    name = key if isinstance(key, str) and len(key) <= _MAX_KEY and key.isprintable() else show(key)
    return f"{path}.{name}" if path else name


@dataclass(frozen=True)
class Node:
    """A value, its dotted path, and the list that collects the problems of the whole tree.

    With `is_key`, the value is the key itself that the path ends in, and so are the problems' causes.
    """

    value: object
    path: str
    problems: list[Problem]
    is_key: bool = False

    def child(self, key: object, value: object = None) -> Node:
        """The value at `key` below this one."""
        return Node(value, join(self.path, key), self.problems)

    def key(self, key: object) -> Node:
        """The key `key` below this one, for complaints that it is there."""
        return Node(key, join(self.path, key), self.problems, is_key=True)

    def complain(
        self,
        what: str,
        *,
        got: str | None = None,
        expected: str | None = None,
        hint: str | None = None,
    ) -> None:
        """Note a problem with this value or key."""
        self.problems.append(Problem(self.path, what, got=got, expected=expected, hint=hint, at_key=self.is_key))


@dataclass(frozen=True)
class Kind(Generic[T]):
    """What is expected, in words that follow "expected:", and how it is read; `empty_hint` is a hint for no value."""

    expected: str
    parse: Callable[[Node], T]
    empty_hint: str | None = None

    def read(self, node: Node) -> T:
        """The checked value, or INVALID."""
        if node.value is None:
            return self.refuse(node, "no value", hint=self.empty_hint)
        return self.parse(node)

    def refuse(
        self,
        node: Node,
        what: str,
        *,
        got: str | None = None,
        expected: str | None = None,
        hint: str | None = None,
    ) -> T:
        """Note that the value is not of this kind; returns INVALID, whatever the type says."""
        node.complain(what, got=got, expected=expected or self.expected, hint=hint)
        stand_in: T = INVALID
        return stand_in


def show(value: object) -> str:
    """A value as a user would write it, on one line and cut to a readable length."""
    text = _flow(value, depth=0)
    return text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 3] + "..."


def _flow(value: object, depth: int) -> str:
    if not isinstance(value, (list, tuple, Mapping)):
        return _scalar(value)
    if depth == 3:
        return "..."
    if isinstance(value, Mapping):
        pairs = [f"{join('', key)}: {_flow(item, depth + 1)}" for key, item in list(value.items())[:_MAX_SHOWN]]
        return "{" + ", ".join(pairs) + "}"
    return "[" + ", ".join(_flow(item, depth + 1) for item in value[:_MAX_SHOWN]) + "]"


def _scalar(value: object) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int) and value.bit_length() > 4 * _MAX_SHOWN:  # Python refuses to spell very large ones
        return "a huge number"
    if isinstance(value, float):
        return repr(value).removesuffix(".0") if math.isfinite(value) else f".{value}"
    return repr(value[:_MAX_SHOWN] if isinstance(value, str) else value)


Table = Mapping[str, Kind[Any]]


def listed(names: Iterable[object], last: str = "or") -> str:
    """`a, b or c`."""
    *most, final = [str(name) for name in names]
    return f"{', '.join(most)} {last} {final}" if most else final


TILDE_HINT = "~ is not expanded: write the whole path"


def has_unexpanded_tilde(name: str) -> bool:
    """Whether a name means a file in somebody's home, and would be one in a folder `~` of the current one."""
    return name == "~" or name.startswith("~/")


def did_you_mean(name: object, names: Iterable[str]) -> str | None:
    """A hint that names the nearest of `names`, or None."""
    close = closest_match(name, names) if isinstance(name, str) else None
    return f"did you mean {close}?" if close else None


# Scalars


def number(
    *, least: float | None = None, most: float | None = None, above: float | None = None, below: float | None = None
) -> Kind[float]:
    """A finite number in a range: `least` and `most` belong to it, `above` and `below` do not.

    Text that spells a number is taken as one, because YAML 1.1 reads `1e-3` as text.
    """

    def parse(node: Node) -> float:
        value = _as_float(node.value)
        if value is None:
            return kind.refuse(node, "not a number", got=show(node.value), hint=_decimal_point_hint(node.value))
        if not math.isfinite(value):
            return kind.refuse(node, "not a finite number", got=show(node.value))
        if isinstance(node.value, str) and underflows(node.value):
            hint = "the smallest number above 0 is 5e-324; for zero write 0"
            return kind.refuse(node, "too small a number to tell from 0", got=show(node.value), hint=hint)
        if not _within(value, least, most, above, below):
            return kind.refuse(node, "out of range", got=show(node.value))
        return value

    kind: Kind[float] = Kind("a number" + _range(least, most, above, below), parse)
    return kind


def integer(*, least: int, most: int) -> Kind[int]:
    """A whole number from `least` to `most`; `1e3` and `120.0` are whole, and so is text that spells one."""

    def parse(node: Node) -> int:
        value = as_int(node.value)
        if value is None:
            return kind.refuse(node, "not a whole number", got=show(node.value), hint=_decimal_point_hint(node.value))
        if not _within(value, least, most, None, None):
            return kind.refuse(node, "out of range", got=show(node.value))
        return value

    kind: Kind[int] = Kind("a whole number" + _range(least, most, None, None), parse)
    return kind


def _decimal_point_hint(value: object) -> str | None:
    """A hint for text that is a number but for its decimal comma."""
    if not isinstance(value, str) or not _DECIMAL_COMMA.fullmatch(value):
        return None
    return f"decimals come after a point: {value.replace(',', '.')}"


def underflows(text: str) -> bool:
    """Whether text that spells a number spells one that is not 0, and that float64 has only as 0."""
    mantissa, _, _ = text.lower().partition("e")
    return float(text) == 0 and any(digit in mantissa for digit in "123456789")


def _as_float(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        return None
    if isinstance(value, str) and not _NUMBER.fullmatch(value):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf


def as_int(value: object) -> int | None:
    """The whole number that a value is or, as text, spells; None for others."""
    if isinstance(value, int) and not isinstance(value, bool):
        return value
    as_float = _as_float(value)
    if as_float is None or not as_float.is_integer() or (isinstance(value, str) and underflows(value)):
        return None
    return int(as_float)


def _within(value: float, least: float | None, most: float | None, above: float | None, below: float | None) -> bool:
    return (
        (least is None or value >= least)
        and (most is None or value <= most)
        and (above is None or value > above)
        and (below is None or value < below)
    )


def _range(least: float | None, most: float | None, above: float | None, below: float | None) -> str:
    if least is not None and most is not None:
        return f" from {show(least)} to {show(most)}"
    parts = (("of at least", least), ("greater than", above), ("less than", below), ("at most", most))
    words = [f"{word} {show(bound)}" for word, bound in parts if bound is not None]
    return f" {listed(words, 'and')}" if words else ""


LENGTH: Kind[float] = number(least=MIN_WORLD_LENGTH, most=MAX_WORLD_LENGTH)
COORDINATE: Kind[float] = number(least=-MAX_WORLD_LENGTH, most=MAX_WORLD_LENGTH)


def _parse_boolean(node: Node) -> bool:
    if isinstance(node.value, bool):
        return node.value
    return BOOLEAN.refuse(node, "not true or false", got=show(node.value))


BOOLEAN: Kind[bool] = Kind("true or false", _parse_boolean)


def _parse_text(node: Node) -> str:
    return node.value if isinstance(node.value, str) else TEXT.refuse(node, "not text", got=show(node.value))


TEXT: Kind[str] = Kind("text", _parse_text)


def choice(*names: str, instead: Mapping[str, str] | None = None) -> Kind[Any]:
    """One of `names`; `instead` maps other programs' words to ours for the hint."""

    def parse(node: Node) -> str:
        if isinstance(node.value, str) and node.value in names:
            return node.value
        meant = (instead or {}).get(node.value) if isinstance(node.value, str) else None
        hint = f"did you mean {meant}?" if meant else did_you_mean(node.value, names)
        return kind.refuse(node, "unknown value", got=show(node.value), hint=hint)

    kind: Kind[str] = Kind(listed(names), parse)
    return kind


# Lists and mappings


def _parse_mapping(node: Node) -> dict[str, Any]:
    return node.value if isinstance(node.value, dict) else MAPPING.refuse(node, "not a mapping", got=show(node.value))


MAPPING: Kind[dict[str, Any]] = Kind("a mapping", _parse_mapping)


def sequence(item: Kind[T], expected: str, *, count: int | None = None) -> Kind[tuple[T, ...]]:
    """A list of `count` items, or of one or more; items that are wrong are INVALID."""

    def parse(node: Node) -> tuple[T, ...]:
        if not isinstance(node.value, (list, tuple)):
            return kind.refuse(node, "not a list", got=show(node.value))
        if len(node.value) != count if count else not node.value:
            return kind.refuse(node, "wrong number of items", got=show(node.value))
        return tuple(item.read(node.child(index, value)) for index, value in enumerate(node.value))

    kind: Kind[tuple[T, ...]] = Kind(expected, parse)
    return kind


def section(
    table: Table,
    build: Callable[[Node, dict[str, Any]], T],
    *,
    required: Collection[str] = (),
    elsewhere: Mapping[str, str] | None = None,
) -> Kind[T]:
    """A mapping with the keys of `table`; `build` makes the value from those that are given, checking them together.

    elsewhere: as `fields` takes it.
    """

    def read(node: Node) -> T:
        return build(node, fields(node, table, required=required, elsewhere=elsewhere))

    return Kind(_mapping_with(table, required), read)


def _mapping_with(table: Table, required: Collection[str]) -> str:
    return f"a mapping with {listed(required, 'and') if required else listed(table)}"


def fields(
    node: Node,
    table: Table,
    *,
    required: Collection[str] = (),
    elsewhere: Mapping[str, str] | None = None,
) -> dict[str, Any]:
    """The values of a mapping's known keys, complaining about unknown and missing ones.

    Optional keys that are not there are not in the result, so that defaults stay with the dataclass that has them.
    `elsewhere` gives hints for keys that would be right in another place.
    """
    if not isinstance(node.value, Mapping):
        node.complain("not a mapping", got=show(node.value), expected=_mapping_with(table, required))
        return dict.fromkeys(table, INVALID)
    given: dict[str, Any] = {}
    for key, value in node.value.items():
        if key in table:
            given[key] = table[key].read(node.child(key, value))
            continue
        close = closest_match(key, table) if isinstance(key, str) else None
        other_place = (elsewhere or {}).get(key) if isinstance(key, str) else None
        hint = other_place or (f"did you mean {close}?" if close else None)
        if value is None and type(key) is int:  # as of {opacity: 0,5}
            hint = "decimals come after a point; in {...} and [...] a comma begins what comes next"
        node.key(key).complain("unknown key", expected=listed(table), hint=hint)
        if close and close not in node.value:  # a misspelt key is not missing, too
            given[close] = INVALID
    for key in required:
        if key not in given:
            table[key].refuse(node.child(key), "missing")
            given[key] = INVALID
    return given


def known(given: Mapping[str, Any], *keys: str) -> list[str]:
    """Those of `keys` that were given and read without a complaint."""
    return [key for key in keys if given.get(key, INVALID) is not INVALID]
