"""Tell whether a regular expression takes linear time on every text.

A repeat without a bound may cost more than its length in three ways: inside another such repeat; where what follows may
begin with a character that the repeat takes, too, so that each of its ends is tried; and where a search begins again
inside of what it has taken, and fails again. A pattern is linear if no repeat is of the first kind, none of the third,
and at most one of the second, without another repeat behind it.
"""

from __future__ import annotations

import importlib
import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

# The parser of Python's own module, under the name that it has in each version.
_parser: Any = importlib.import_module("re._parser" if sys.version_info >= (3, 11) else "sre_parse")

# Repeats up to this bound are short.
_MOST_TIMES = 1000
# All characters that patterns tell apart: the first 256, and one more of each category.
_ALL = frozenset([*map(chr, range(256)), "\u2028", "\u0660", "\u4e00"])
_CATEGORIES = {
    "CATEGORY_DIGIT": r"\d",
    "CATEGORY_NOT_DIGIT": r"\D",
    "CATEGORY_SPACE": r"\s",
    "CATEGORY_NOT_SPACE": r"\S",
    "CATEGORY_WORD": r"\w",
    "CATEGORY_NOT_WORD": r"\W",
}
_REPEATS = ("MAX_REPEAT", "MIN_REPEAT")
_LOOKS = ("ASSERT", "ASSERT_NOT")

Chars = frozenset[str]
Tree = Sequence[tuple[Any, Any]]


@dataclass(frozen=True)
class _After:
    """What follows a place in a pattern: with which characters it may begin, whether it has a repeat without a bound,
    and whether there is nothing, so that what is before it cannot fail any more."""

    first: Chars = frozenset()
    has_repeat: bool = False
    is_end: bool = False


class NotLinearError(Exception):
    """A pattern that may take more than linear time."""


def require_linear(pattern: str | bytes, flags: int = 0, *, is_search: bool) -> None:
    """Raise NotLinearError for a pattern that may take more than linear time.

    is_search: whether it may begin anywhere in a text, as in `search`, `findall`, `sub` and `split`.
    """
    tree = _parser.parse(pattern, flags)
    flags = int(tree.state.flags)
    top = list(tree)
    branches = [list(each) for each in top[0][1][1]] if len(top) == 1 and str(top[0][0]) == "BRANCH" else [top]
    for branch in branches:
        check = _Check(flags)
        check.sequence(branch, _After(is_end=True))
        if is_search and check.taken & _starts(branch, flags):
            raise NotLinearError("a search begins again inside of a repeat")


class _Check:
    """A walk through a pattern from its end. taken: by repeats behind which it may still fail."""

    def __init__(self, flags: int) -> None:
        self._flags = flags
        self._num_ambiguous = 0
        self.taken: Chars = frozenset()

    def sequence(self, tree: Tree, after: _After) -> _After:
        """Check a sequence, and return what follows the place before it."""
        for kind, value in reversed(tree):
            after = self._item(str(kind), value, after)
        return after

    def _item(self, kind: str, value: Any, after: _After) -> _After:
        if kind == "SUBPATTERN":
            return self.sequence(list(value[3]), after)
        if kind == "BRANCH":
            found = [self.sequence(list(each), after) for each in value[1]]
            return _either(found)
        if kind in _REPEATS:
            return self._repeat(*value, after)
        if kind in _LOOKS:
            inside = self.sequence(list(value[1]), _After())
            return replace(after, has_repeat=after.has_repeat or inside.has_repeat, is_end=False)
        if kind == "AT":
            return replace(after, is_end=False)
        if kind == "GROUPREF":
            raise NotLinearError("a reference to a group")
        return _After(_chars(kind, value, self._flags), after.has_repeat)

    def _repeat(self, least: int, most: Any, inner: Any, after: _After) -> _After:
        once = self.sequence(list(inner), _After())
        again = _either([once, after])
        if int(most) <= _MOST_TIMES:
            if once.has_repeat and int(most) > 1:
                again = replace(again, has_repeat=True)
            inside = self.sequence(list(inner), again if int(most) > 1 else after) if once.has_repeat else once
            has_repeat = once.has_repeat or after.has_repeat
            return replace(_either([inside, after]) if least == 0 else inside, has_repeat=has_repeat, is_end=False)
        if once.has_repeat:
            raise NotLinearError("a repeat inside a repeat")
        if once.first & after.first:
            self._num_ambiguous += 1
            if after.has_repeat or self._num_ambiguous > 1:
                raise NotLinearError("two repeats, or a repeat and another behind it, take the same characters")
        if not after.is_end:
            self.taken |= _all_chars(list(inner), self._flags)
        return replace(again if least == 0 else once, has_repeat=True, is_end=False)


def _either(found: Sequence[_After]) -> _After:
    first = frozenset[str]().union(*(each.first for each in found))
    return _After(first, any(each.has_repeat for each in found), all(each.is_end for each in found))


def _starts(tree: Tree, flags: int) -> Chars:
    """Return the characters where a search may begin again: the first ones, or the one before the begin of a line."""
    kind, value = str(tree[0][0]), str(tree[0][1])
    if kind == "AT" and value.startswith("AT_BEGINNING"):
        return frozenset("\n") if flags & re.MULTILINE and value == "AT_BEGINNING" else frozenset()
    if kind == "SUBPATTERN":
        return _starts([*tree[0][1][3], *tree[1:]], flags)
    return _Check(flags).sequence(tree, _After()).first


def _all_chars(tree: Tree, flags: int) -> Chars:
    """Return all characters that a sequence without unbounded repeats may take."""
    found: Chars = frozenset()
    for kind, value in tree:
        name = str(kind)
        if name == "SUBPATTERN":
            found |= _all_chars(list(value[3]), flags)
        elif name == "BRANCH":
            found = found.union(*(_all_chars(list(each), flags) for each in value[1]))
        elif name in _REPEATS:
            found |= _all_chars(list(value[2]), flags)
        elif name not in (*_LOOKS, "AT"):
            found |= _chars(name, value, flags)
    return found


def _chars(kind: str, value: Any, flags: int) -> Chars:
    """Return the characters that one item of a pattern takes."""
    if kind == "ANY":
        return _ALL if flags & re.DOTALL else _ALL - {"\n"}
    if kind == "NOT_LITERAL":
        return _ALL - _cased({chr(value)}, flags)
    if kind == "LITERAL":
        return _cased({chr(value)}, flags)
    if kind != "IN":
        raise NotLinearError(f"{kind}, which is not known")
    found, is_negated = set[str](), False
    for each, item in value:
        name = str(each)
        if name == "NEGATE":
            is_negated = True
        elif name == "LITERAL":
            found.add(chr(item))
        elif name == "RANGE":
            found |= {each for each in _ALL if item[0] <= ord(each) <= item[1]}
        else:
            pattern = re.compile(_CATEGORIES[str(item)], flags & re.ASCII)
            found |= {each for each in _ALL if pattern.fullmatch(each)}
    cased = _cased(found, flags)
    return _ALL - cased if is_negated else cased


def _cased(chars: set[str], flags: int) -> Chars:
    if not flags & re.IGNORECASE:
        return frozenset(chars)
    return frozenset({form for each in chars for form in (each.lower(), each.upper(), each)})
