"""Read text, numbers, curves, JSON and XML of a look's file, with errors that name the place."""

from __future__ import annotations

import json
import math
import re
import reprlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar
from xml.etree import ElementTree

from renderer.errors import InputError
from renderer.looks.curves import CurvePoint, by_value
from renderer.system import number_in

T = TypeVar("T")

# The largest size in bytes of a file with looks or labels. The largest files that come with programs have 300 kB: a
# hundred colormaps, or thousands of labels.
MAX_LOOK_BYTES = 2**22
# The largest length of a list of numbers in a file with looks.
_MAX_NUMBERS = 2**18
# Matches a comma before the end of a list or an object in JSON, which some programs write.
_TRAILING_COMMA = re.compile(r",(?=\s*[\]}])")
# The names of JSON's types in messages.
_KINDS: dict[type, str] = {dict: "an object", list: "a list", str: "text"}


@dataclass(frozen=True)
class LookFile:
    """The content of a file that may hold looks or labels. kind: the description of the file's format, for errors."""

    path: Path
    content: bytes
    kind: str

    def error(self, what: str, at: object = None, *, got: object = None, **parts: str | None) -> InputError:
        """Return an error about this file.

        what: a sentence that states the mistake. at: the number of a line, or words for a place. got: the value that
        was found. parts: `expected` or `hint`, as in InputError.
        """
        where = str(self.path) if at is None else f"{self.path}:{at}" if isinstance(at, int) else f"{self.path}: {at}"
        shown = None if got is None else reprlib.repr(got)
        hint = f"it is read as {self.kind}"
        return InputError(what, where=where, got=shown, **{"hint": hint, **parts})

    def text(self) -> str:
        """Return the text of the file, which must be UTF-8."""
        try:
            return self.content.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line, byte = self.content.count(b"\n", 0, error.start) + 1, self.content[error.start : error.start + 1]
            raise self.error("not a text file in UTF-8", line, got=byte) from error

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield the number and the text of each line that is neither empty nor a comment. Lines count from 1."""
        for number, line in enumerate(self.text().splitlines(), start=1):
            if line.strip() and not line.lstrip().startswith("#"):
                yield number, line.strip()

    def number(self, value: object, at: object, low: float = -math.inf, high: float = math.inf) -> float:
        """Return a number of the file, given as a number or as text.

        at: the place in the file, for messages. Raises InputError unless the number is finite and from `low` to `high`.
        """
        found = math.nan
        if isinstance(value, str):
            found = number_in(value.strip())
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            with suppress(OverflowError):
                found = float(value)
        if math.isfinite(found) and low <= found <= high:
            return found
        limits = f" from {low:g} to {high:g}" if math.isfinite(low) and math.isfinite(high) else ""
        got = "nothing" if value is None else value
        raise self.error("not such a number", at, got=got, expected=f"a finite number{limits}")

    def groups(self, values: object, at: object, size: int) -> list[list[Any]]:
        """Return the items of a list in groups of `size` items. Raises InputError for a list that has no such groups.

        at: the place in the file, for messages.
        """
        if not isinstance(values, list) or not 0 < len(values) <= _MAX_NUMBERS or len(values) % size:
            expected = f"groups of {size} numbers, at most {_MAX_NUMBERS} numbers"
            got = f"{len(values)} items" if isinstance(values, list) else values
            raise self.error("not such a list of numbers", at, got=got, expected=expected)
        return [values[k : k + size] for k in range(0, len(values), size)]

    def curve(self, rows: Iterable[Sequence[Any]], num_parts: int, white: float = 1.0) -> list[CurvePoint]:
        """Return the curve through the points of some rows, sorted by value.

        rows: for each point its place in the file (for messages), its value, and `num_parts` numbers from 0 to `white`,
        which are divided by `white`. Raises InputError for rows without these numbers.
        """
        points = list[CurvePoint]()
        for at, value, *parts in rows:
            if len(parts) != num_parts:
                expected = f"{num_parts} numbers from 0 to {white:g}"
                raise self.error("not a colour or opacity", at, got=" ".join(map(str, parts)), expected=expected)
            shares = (self.number(part, at, 0.0, white) / white for part in parts)
            points.append((self.number(value, at), tuple(shares)))
        if not points:
            raise self.error("no colours")
        return by_value(points)

    def member(self, tree: Any, key: str, kind: type[T], at: str) -> T:
        """Return the value of a key in a JSON object. Raises InputError unless the value has the type `kind`.

        tree: the object. at: the place in the file, for messages.
        """
        found = tree.get(key) if isinstance(tree, dict) else None
        if isinstance(found, kind):
            return found
        raise self.error(f"no {key}", at, got=found, expected=f"{key} with {_KINDS[kind]}")

    def json(self) -> Any:
        """Return the data of a JSON file. Lists and objects may end with a comma."""
        try:
            return json.loads(_TRAILING_COMMA.sub("", self.text()), parse_constant=float)
        except (ValueError, RecursionError) as error:
            message, line = getattr(error, "msg", "too many levels or digits"), getattr(error, "lineno", None)
            raise self.error(f"not valid JSON: {message}", line) from error

    def xml(self) -> ElementTree.Element:
        """Return the root of an XML file.

        Raises InputError for text that is not XML, and for a document type, whose entities may need endless memory.
        """
        text = self.text()
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise self.error("has a document type", hint="it needs neither DOCTYPE nor ENTITY")
        try:
            return ElementTree.fromstring(text)
        except (ElementTree.ParseError, ValueError) as error:
            line = getattr(error, "position", (None,))[0]
            raise self.error(f"not valid XML: {error}", line) from error

    def child(self, element: ElementTree.Element, *names: str) -> ElementTree.Element:
        """Return the first child of an XML element with one of the names. Raises InputError without such a child."""
        found = next((child for child in element if child.tag in names), None)
        if found is None:
            raise self.error(f"no <{names[0]}>", f"<{element.tag}>")
        return found
