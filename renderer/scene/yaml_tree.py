"""Parse YAML text to plain data, with the line and column of every key and value, and write plain data as YAML.

Scenes need mappings, lists, text, numbers, true, false, null, and anchors within bounds. Numbers follow YAML 1.2: by
YAML 1.1, PyYAML reads 1e-3 as text, 010 as 8 and 1:30 as 90.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from renderer.errors import InputError, Problem
from renderer.scene.input_file import decode_utf8
from renderer.scene.message_text import format_value, join_keys
from renderer.system import join_lines, printable

# The largest number of values in a scene file. Scenes have a few hundred; far more are a mistake or an attack.
MAX_NODES = 20_000
# The largest number of levels of mappings and lists in a scene file. Scenes have three or four; far more are a mistake
# or an attack.
MAX_DEPTH = 50

# The largest number of digits of a whole number that is read exactly: the lowest limit that Python can be set to.
_MAX_DIGITS = 640

LINE_BREAK = re.compile("\r\n|[\r\n\x85\u2028\u2029]")

_TAG = "tag:yaml.org,2002:"


class TextPosition(NamedTuple):
    """A position in the text; line and column count from 1."""

    line: int
    column: int


class SourceLocation(NamedTuple):
    """A pair of positions, where a key and its value begin.

    A list item has no key, so both are the position of the item. A mapping or list in block style is located at its
    key.
    """

    key: TextPosition
    value: TextPosition


@dataclass
class YamlTree:
    """A tree of plain data, the locations of its dotted paths, and the problems that did not prevent reading.

    lines: the lines of the text, which are shown with problems.
    """

    data: Any = None
    lines: Sequence[str] = ()
    locations: dict[str, SourceLocation] = field(default_factory=dict)
    problems: list[tuple[TextPosition, Problem]] = field(default_factory=list)


class NotYamlError(Exception):
    """An error of text that cannot be parsed at all: the mistake, its place if known, and a hint."""

    def __init__(self, what: str, mark: TextPosition | None = None, hint: str | None = None) -> None:
        self.what, self.mark, self.hint = what, mark, hint
        super().__init__(what)


def parse_yaml_file(content: bytes, path: Path) -> YamlTree:
    """Return the data in the content of a file. Raises InputError."""
    text = decode_utf8(content, path)
    try:
        return parse_yaml(text)
    except NotYamlError as error:
        what = with_excerpt(error.what, LINE_BREAK.split(text), error.mark)
        raise InputError(what, where=format_location(path, error.mark), hint=error.hint) from error


def format_location(path: Path, mark: TextPosition | None) -> str:
    """Return `scene.yaml:14:13`, or the file alone if the position is unknown."""
    return str(path) if mark is None else f"{path}:{mark.line}:{mark.column}"


def with_excerpt(what: str, lines: Sequence[str], mark: TextPosition | None) -> str:
    """Return a message with a line of the file below it, and a caret below the column."""
    if mark is None:
        return what
    line = lines[mark.line - 1].replace("\t", " ").rstrip()
    if printable(line) != line or not 0 < len(line) <= _MAX_LINE:  # escapes would shift the column
        return what
    indent = len(line) - len(line.lstrip())
    return join_lines([what, f"    | {line[indent:]}", f"    | {' ' * (mark.column - 1 - indent)}^"])


_MAX_LINE = 120


def parse_yaml(text: str) -> YamlTree:
    """Return the data in `text`; None if it has nothing but comments. Raises NotYamlError."""
    tree = _Builder(lines=LINE_BREAK.split(text))
    try:
        node = yaml.compose(text, Loader=_Loader)
        if node is not None:
            tree.data = tree.build(node, "", key=None, depth=0)
    except yaml.reader.ReaderError as error:
        lines = LINE_BREAK.split(text[: error.position])
        what = f"not valid YAML: the character {error.character!r} may not be in it"
        raise NotYamlError(what, TextPosition(len(lines), len(lines[-1]) + 1)) from error
    except yaml.MarkedYAMLError as error:
        raise _plain_error(error, text) from error
    except (ValueError, OverflowError) as error:  # PyYAML lets the error of chr() through
        raise NotYamlError("not valid YAML: an escape for a character that does not exist") from error
    return tree


class _Loader(yaml.SafeLoader):
    """A loader that composes nodes, limited in number and depth, with scalars of YAML 1.2; it constructs nothing."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012  (PyYAML's name; it is filled in below)

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._depth = self._num_values = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        # The limits are checked here, too, as composing a large text takes seconds and hundreds of megabytes.
        if parent is None or index is not None:  # a node below another one and without an index is a key
            self._num_values += 1
        if self._num_values > MAX_NODES:
            raise _limit_error(f"{MAX_NODES} values")
        self._depth += 1
        if self._depth > MAX_DEPTH:
            mark: yaml.Mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise _limit_error(f"{MAX_DEPTH} levels", mark)
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node


for _name, _pattern, _first in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?[0-9]+", list("-+0123456789")),
    ("float", r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?", list("-+.0123456789")),
    ("float", r"[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", list("-+.")),
):
    _Loader.add_implicit_resolver(_TAG + _name, re.compile(f"(?:{_pattern})$"), _first)


class _Dumper(yaml.SafeDumper):
    """A dumper whose text `_Loader` reads back as the same data: scalars follow YAML 1.2, and there are no aliases."""

    yaml_implicit_resolvers = _Loader.yaml_implicit_resolvers

    def ignore_aliases(self, data: object) -> bool:
        return True


def dump_yaml(data: object) -> str:
    """Return plain data as YAML, with mappings and lists of scalars on one line."""
    text: str = yaml.dump(data, Dumper=_Dumper, sort_keys=False, default_flow_style=None, allow_unicode=True, width=110)
    return text


class _Builder(YamlTree):
    """A builder that turns nodes into data, and follows anchors within the limits."""

    num_nodes = 0

    def build(self, node: yaml.Node, path: str, *, key: yaml.Node | None, depth: int) -> Any:
        self.num_nodes += 1
        if self.num_nodes > MAX_NODES:
            raise _limit_error(f"{MAX_NODES} values")
        if depth > MAX_DEPTH:  # an anchor may contain itself
            raise _limit_error(f"{MAX_DEPTH} levels", node.start_mark)
        at_key = _mark((key or node).start_mark)
        is_block = isinstance(node, yaml.CollectionNode) and not node.flow_style
        self.locations[path] = SourceLocation(at_key, at_key if is_block else _mark(node.start_mark))
        if isinstance(node, yaml.CollectionNode) and node.tag not in (f"{_TAG}map", f"{_TAG}seq"):
            self._reject_tag(node, path)
        if isinstance(node, yaml.MappingNode):
            return self._mapping(node, path, depth)
        if isinstance(node, yaml.SequenceNode):
            return [
                self.build(item, join_keys(path, index), key=None, depth=depth + 1)
                for index, item in enumerate(node.value)
            ]
        return self._scalar(node, path)

    def _mapping(self, node: yaml.MappingNode, path: str, depth: int) -> dict[Hashable, Any]:
        data: dict[Hashable, Any] = {}
        lines: dict[Hashable, int] = {}
        for key_node, value_node in node.value:
            mark = _mark(key_node.start_mark)
            if not isinstance(key_node, yaml.ScalarNode):
                problem = Problem(path, "a key that is a list or a mapping", expected="text or a number")
                self.problems.append((mark, problem))
                continue
            key = self._scalar(key_node, path)
            place = join_keys(path, key)
            if key in lines:
                hint = f"it is in line {lines[key]}, too" if lines[key] != mark.line else None
                self.problems.append((mark, Problem(place, "the same key twice", hint=hint)))
                continue
            lines[key] = mark.line
            data[key] = self.build(value_node, place, key=key_node, depth=depth + 1)
        return data

    def _scalar(self, node: yaml.Node, path: str) -> Any:
        kind, text = node.tag.removeprefix(_TAG), node.value
        try:
            if kind == "int" and len(text) <= _MAX_DIGITS:
                return int(text)
            if kind in ("int", "float"):
                return float(text.lower().replace(".inf", "inf").replace(".nan", "nan"))
            if kind in ("null", "bool"):
                return {"n": None, "~": None, "": None, "t": True, "f": False}[text[:1].lower()]
        except (KeyError, ValueError):  # an explicit tag, such as !!int, does not fit the text
            kind = "?"
        if kind != "str":
            self._reject_tag(node, path)
        return _join_surrogates(text)

    def _reject_tag(self, node: yaml.Node, path: str) -> None:
        problem = Problem(path, "tags are not used here", got=format_value(node.tag), hint="remove what begins with !")
        self.problems.append((_mark(node.start_mark), problem))


def _join_surrogates(text: str) -> str:
    """Return a text in which a surrogate pair, which JSON has in place of an emoji, is replaced by its character."""
    return text.encode("utf-16", "surrogatepass").decode("utf-16", "surrogatepass")


def _mark(mark: yaml.Mark) -> TextPosition:
    return TextPosition(mark.line + 1, mark.column + 1)


def _limit_error(limit: str, mark: yaml.Mark | None = None) -> yaml.MarkedYAMLError:
    return yaml.MarkedYAMLError(problem=f"more than {limit}", problem_mark=mark)


# The beginnings of PyYAML's messages, each with plain words for the mistake, and a hint.
_PYYAML_MESSAGES = (
    ("found character '\\t'", "a tab", "indent with spaces"),
    (
        "expected <block end>",
        "this does not belong to what is above it",
        "compare its indentation with that of line {begin}",
    ),
    (
        "mapping values are not allowed",
        "a colon that cannot be there",
        "put text with a colon in quotes; check the indentation",
    ),
    ("could not find expected ':'", "a key without a colon", "write `key: value`, with a blank after the colon"),
    ("found unexpected end of stream", "a quote that is not closed", "it is opened in line {begin}"),
    ("expected the node content", "a value that is missing or not finished", None),
    ("but found another document", "a second document", "one document a file: remove everything from this --- on"),
    ("found undefined alias", "an alias without an anchor", "put text that begins with * in quotes"),
    ("second occurrence", "a second anchor of this name", "the other one is in line {begin}"),
)


# Patterns of text that is often written without the necessary quotes.
_COLOR = re.compile(r"\s#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})\b")
_UNQUOTED = (
    (_COLOR, 'put colors in quotes, for # begins a comment: "#ff8800"'),
    (re.compile(r"""^[^"'#]*\{frame[:}]"""), 'put names with braces in quotes: "frames/{frame:04}.png"'),
)


def _plain_error(error: yaml.MarkedYAMLError, text: str) -> NotYamlError:
    problem = error.problem or error.context or "unreadable"
    mark = _mark(error.problem_mark) if error.problem_mark else None
    begin = error.context_mark.line + 1 if error.context_mark else None
    hint = "it belongs to what begins in line {begin}" if begin and mark and begin != mark.line else None
    unquoted = _missing_quotes_hint(text, mark) if problem.startswith("expected") else None
    for beginning, words, advice in _PYYAML_MESSAGES:
        if problem.startswith(beginning):
            problem, hint = words, advice
    return NotYamlError(f"not valid YAML: {problem}", mark, unquoted or (hint.format(begin=begin) if hint else None))


def _missing_quotes_hint(text: str, mark: TextPosition | None) -> str | None:
    """Return a hint for text without quotes on the line of a mistake or the line before, where it may begin."""
    lines = [] if mark is None else [line for line in LINE_BREAK.split(text)[: mark.line] if line.strip()]
    found = (hint for line in lines[:-3:-1] for pattern, hint in _UNQUOTED if pattern.search(line))
    return next(found, None)
