"""The errors a user can meet: one root, one child for each exit code, and the scene file's list of complaints.

The low layer states the fact; the layer above adds the place (a file, a line). Only `hsplat_cli` prints them and exits.
`assert` is for the program's own invariants and never for input.
"""

from __future__ import annotations

import difflib
import importlib.util
from collections.abc import Iterable, Sequence
from dataclasses import dataclass


class HsplatError(Exception):
    """Root of all errors that are shown to a user.

    Parameters
    ----------
    what: one sentence, what is wrong.
    where: a file, a place in it, or a part of the scene.
    got, expected: what was found and what would have been right.
    hint: what to do about it.
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


class InputError(HsplatError):
    """The scene, the volume or the command line is wrong (exit code 2)."""


class OutputLockedError(InputError):
    """Another job is writing the same output, of which nothing was touched."""


class RenderError(HsplatError):
    """The input was right and the render failed: no GL, no disk, no encoder (exit code 1)."""


class ContextLostError(RenderError):
    """OpenGL failed while something was drawn, which with another context may succeed."""


@dataclass(frozen=True)
class Problem:
    """One complaint about a scene.

    Parameters
    ----------
    path: the dotted key, list items by number: `transfer_function.points.2.value`; empty for the scene as a whole.
    what, got, expected, hint: as in HsplatError.
    at_key: the mistake is that the key is there at all, not its value.
    location: where that is written (`scene.yaml:14:13`); known only to the layer that read the file.
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
    """Everything that is wrong with a scene, all at once; `problems` is ordered as in the scene's schema, or by place
    once the places are known."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))


def format_message(
    what: str, *, where: str | None = None, got: str | None = None, expected: str | None = None, hint: str | None = None
) -> str:
    """The text of a message: `where: what` and one indented line for each further part that there is."""
    lines = [what if where is None else f"{where}: {what}"]
    lines += [f"  {name}: {text}" for name, text in (("got", got), ("expected", expected), ("hint", hint)) if text]
    return "\n".join(lines)


def closest_match(name: str, names: Iterable[str]) -> str | None:
    """The one of `names` that `name` was probably meant to be, or None."""
    return next(iter(difflib.get_close_matches(name, list(names), n=1, cutoff=0.6)), None)


def require_package(package: str, *, extra: str) -> None:
    """Raise InputError if an optional package, by the name under which it is imported, is not installed.

    To be called where the work begins, and not only where the package is used at its end.
    extra: that which brings it, of those in `pyproject.toml`.
    """
    if importlib.util.find_spec(package) is None:
        raise InputError(f"the package {package} is not installed", hint=f"pip install 'hsplat[{extra}]'")
