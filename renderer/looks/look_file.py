"""Read text, numbers, JSON and XML of a look's file, and make its errors."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar
from xml.etree import ElementTree

from renderer.errors import InputError
from renderer.looks.curves import Color

T = TypeVar("T")

# The largest files that programs come with, a hundred colormaps or thousands of labels, have 300 kB.
MAX_LOOK_BYTES = 2**22
# A table of labels has two for each.
_MAX_NUMBERS = 2**18
_MAX_GOT = 60

_TRAILING_COMMA = re.compile(r",(?=\s*[\]}])")
_KINDS: dict[type, str] = {dict: "an object", list: "a list", str: "text"}


@dataclass(frozen=True)
class LookFile:
    """A file that may hold looks."""

    path: Path
    content: bytes

    def error(self, what: str, at: object = None, *, got: object = None, **parts: str | None) -> InputError:
        """Return an error in this file. at: the number of a line, or words for a place; parts: of InputError."""
        where = str(self.path) if at is None else f"{self.path}:{at}" if isinstance(at, int) else f"{self.path}: {at}"
        shown = None if got is None else repr(got)
        if shown is not None and len(shown) > _MAX_GOT:
            shown = f"{shown[:_MAX_GOT]}..."
        return InputError(what, where=where, got=shown, **parts)

    def text(self) -> str:
        """Return the text of a file in UTF-8."""
        try:
            return self.content.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = self.content.count(b"\n", 0, error.start) + 1
            raise self.error(
                "not a text file in UTF-8", line, got=self.content[error.start : error.start + 1]
            ) from error

    def lines(self) -> Iterator[tuple[int, str]]:
        """Yield the number, from 1, and the text of each line that has more than a comment."""
        for number, line in enumerate(self.text().splitlines(), start=1):
            if line.strip() and not line.lstrip().startswith("#"):
                yield number, line.strip()

    def number(self, value: object, at: object, low: float = -math.inf, high: float = math.inf) -> float:
        """Return a finite number from `low` to `high`, or the one that a text spells."""
        try:
            found = float(value) if isinstance(value, (int, float, str)) and not isinstance(value, bool) else math.nan
        except (ValueError, OverflowError):
            found = math.nan
        if math.isfinite(found) and low <= found <= high:
            return found
        limits = f" from {low:g} to {high:g}" if math.isfinite(low) and math.isfinite(high) else ""
        raise self.error("not such a number", at, got=value, expected=f"a finite number{limits}")

    def numbers(self, values: object, at: object, group: int = 1) -> list[float]:
        """Return a list of numbers, as many as are in one or more groups."""
        if not isinstance(values, list) or not 0 < len(values) <= _MAX_NUMBERS or len(values) % group:
            expected = f"groups of {group} numbers, at most {_MAX_NUMBERS} numbers"
            got = f"{len(values)} items" if isinstance(values, list) else values
            raise self.error("not such a list of numbers", at, got=got, expected=expected)
        return [self.number(value, at) for value in values]

    def color(self, parts: Iterable[object], at: object, white: float = 1.0) -> Color:
        """Return a colour of three numbers from 0 to `white`."""
        red, green, blue = (self.number(part, at, 0.0, white) / white for part in parts)
        return red, green, blue

    def member(self, tree: Any, key: str, kind: type[T], at: str) -> T:
        """Return what an object of JSON has at a key."""
        found = tree.get(key) if isinstance(tree, dict) else None
        if isinstance(found, kind):
            return found
        raise self.error(f"no {key}", at, got=found, expected=f"an object with {key}: {_KINDS[kind]}")

    def json(self) -> Any:
        """Return the data of a JSON file, in which a list may end with a comma."""
        text = self.text()
        try:
            return json.loads(_TRAILING_COMMA.sub("", text), parse_constant=float)
        except json.JSONDecodeError as error:
            raise self.error(f"not valid JSON: {error.msg}", error.lineno) from error
        except (ValueError, RecursionError) as error:
            raise self.error("not valid JSON: too many levels or digits") from error

    def xml(self) -> ElementTree.Element:
        """Return the root of an XML file without declarations of its own, which may ask for endless memory."""
        text = self.text()
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise self.error(
                "has a document type", hint="the XML of transfer functions needs neither DOCTYPE nor ENTITY"
            )
        try:
            return ElementTree.fromstring(text)
        except ElementTree.ParseError as error:
            raise self.error(f"not valid XML: {error}", error.position[0]) from error
        except ValueError as error:
            raise self.error(f"not valid XML: {error}") from error

    def attribute(self, element: ElementTree.Element, name: str, default: str | None = None) -> str:
        """Return an attribute of an XML element."""
        found = element.get(name, default)
        if found is None:
            raise self.error(f"no {name}", f"<{element.tag}>", expected=f'{name}="..."')
        return found

    def child(self, element: ElementTree.Element, *names: str) -> ElementTree.Element:
        """Return the first child of an XML element with one of the names."""
        found = next((child for child in element if child.tag in names), None)
        if found is None:
            raise self.error(f"no <{names[0]}>", f"<{element.tag}>")
        return found
