"""Define the errors that users see: a base class, a class for each exit code, and the list of problems in a scene file.

The code that finds a mistake states it, and code that calls this code adds the location (a file, a line). Only
`hsplat_cli` prints errors and exits. `assert` is for the program's own invariants, never for input.
"""

from __future__ import annotations

import difflib
import importlib.util
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from renderer.system import PrintableText, join_lines, printable

# The largest number of characters of a part of a message, as long as the longest paths. Longer parts lose their middle.
_MAX_LINE = 1000


class HsplatError(Exception):
    """An error that is shown to a user. All other errors derive from it.

    Each text is one line, in which unprintable characters are escaped, or several lines made by
    `renderer.system.join_lines`.

    Parameters
    ----------
    what
        A sentence that states the mistake.
    where
        A file, a location in it, or a part of the scene.
    got
        The value that was found.
    expected
        The values that would be right.
    hint
        A way to correct the mistake.
    """

    def __init__(
        self,
        what: str,
        *,
        where: str | None = None,
        got: str | None = None,
        expected: str | None = None,
        hint: str | None = None,
    ) -> None:
        self.what, self.where, self.got, self.expected, self.hint = what, where, got, expected, hint
        super().__init__(what)

    def __str__(self) -> str:
        return format_message(self.what, where=self.where, got=self.got, expected=self.expected, hint=self.hint)

    @property
    def summary(self) -> str:
        """Return the mistake in a few words, without names and values, which may be private."""
        return self.what.partition("\n")[0]


class InputError(HsplatError):
    """An error in the scene, the volume or the command line (exit code 2)."""

    def problem_at(self, location: str) -> Problem:
        """Return the error as a problem, for a list of problems. location: its place, unless the error states one."""
        return Problem("", self.what, self.got, self.expected, self.hint, location=self.where or location)


class OutputLockedError(InputError):
    """An error: another job is writing the same output. Nothing was changed."""


class RenderError(HsplatError):
    """An error while rendering from correct input: no OpenGL, no disk space, no encoder (exit code 1)."""


class ContextLostError(RenderError):
    """An error: OpenGL failed while drawing. With a new OpenGL context, drawing may succeed."""


@dataclass(frozen=True)
class Problem:
    """A mistake in a scene.

    Parameters
    ----------
    path
        The dotted key, with list items by number: `transfer_function.points.2.value`; empty for the whole scene.
    what
        A sentence that states the mistake.
    got
        The value that was found.
    expected
        The values that would be right.
    hint
        A way to correct the mistake.
    at_key
        Whether the key itself is the mistake, not its value.
    location
        The place of the key or value (`scene.yaml:14:13`), which only the reader of the file knows.
    """

    path: str
    what: str
    got: str | None = None
    expected: str | None = None
    hint: str | None = None
    at_key: bool = False
    location: str | None = None

    def __str__(self) -> str:
        where = ": ".join(part for part in (self.location, self.path) if part)
        return format_message(self.what, where=where or None, got=self.got, expected=self.expected, hint=self.hint)


class SceneError(InputError):
    """An error that lists all problems of a scene, in the order of the schema, or by location if that is known."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__(join_lines(map(str, self.problems)))

    @property
    def summary(self) -> str:
        """Return the first problem in a few words, without names and values."""
        return self.problems[0].what.partition("\n")[0]


def format_message(
    what: str, *, where: str | None = None, got: str | None = None, expected: str | None = None, hint: str | None = None
) -> PrintableText:
    """Return the text of a message, made printable: `where: what`, and an indented line for each of the other parts."""
    lines = [_readable(what) if where is None else f"{_readable(where)}: {_readable(what)}"]
    parts = (("got", got), ("expected", expected), ("hint", hint))
    lines += [f"  {name}: {_readable(text)}".replace("\n", "\n    ") for name, text in parts if text]
    return PrintableText("\n".join(lines))


def _readable(text: str) -> str:
    """Return a text made printable. A text that is too long to be read loses its middle."""
    is_readable = isinstance(text, PrintableText) or len(text) <= _MAX_LINE
    return printable(text if is_readable else f"{text[: _MAX_LINE // 2]}...{text[-_MAX_LINE // 2 :]}")


def closest_match(name: str, names: Iterable[str]) -> str | None:
    """Return the name in `names` that is spelled most like `name`, or None if no name is close."""
    return next(iter(difflib.get_close_matches(name, list(names), n=1, cutoff=0.6)), None)


def require_package(package: str, *, extra: str) -> None:
    """Raise InputError if an optional package is not installed.

    Call this when the work begins, even if the package is needed only at the end.

    package: the name by which the package is imported. extra: the extra in `pyproject.toml` that installs the package.
    """
    if importlib.util.find_spec(package) is None:
        raise InputError(f"the package {package} is not installed", hint=install_line(extra))


def install_line(extra: str) -> str:
    """Return the command that installs an extra."""
    return f"pip install 'hsplat[{extra}]'"
