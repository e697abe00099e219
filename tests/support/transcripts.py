"""Transcripts of the command line: the commands that a user types, and all that they print.

A transcript is a text file of cases. Each case begins with its title, and is run in a folder of its own:

    === a misspelled key
    ~ scene.yaml
    - distance: 300
    + distence: 300
    $ hsplat check scene.yaml
    scene.yaml:12:3: unknown key
    [2]

`~` edits a file: the text of the `+` lines replaces that of the `-` lines, which must stand in the file once; without
`-` lines, the file is written anew. `$` runs a command: hsplat in this process, or `ls`, `cat`, `touch`, `rm`, `cp`,
`mv` or `cmp`. After the command comes its output, standard output before standard error, and its exit code unless that
is 0. In the output, `...` stands for any text, and `/folder` for the current folder.

`HSPLAT_REWRITE=1 pytest tests/messages` writes the present output into the transcripts; read the difference.
"""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from hsplat_cli import main

FOLDER = Path(__file__).parents[1] / "messages"
_TITLE, _EDIT, _COMMAND = "=== ", "~ ", "$ "


@dataclass(frozen=True)
class Case:
    """One case of a transcript: its file, title and lines."""

    path: Path
    title: str
    lines: tuple[str, ...]

    def __str__(self) -> str:
        return self.title

    def check(self, capsys: pytest.CaptureFixture[str]) -> None:
        """Run the case in the current folder. Raises AssertionError if the output differs from the transcript."""
        actual = "".join(_run(step, capsys) for step in _steps(self.lines))
        expected = "".join(f"{line}\n" for line in self.lines)
        if os.environ.get("HSPLAT_REWRITE") == "1" and not _matches(actual, expected):
            text = self.path.read_text("utf-8")
            old = f"{_TITLE}{self.title}\n{expected}"
            assert text.count(old) == 1, self.title
            self.path.write_text(text.replace(old, f"{_TITLE}{self.title}\n{actual}"), "utf-8")
        elif not _matches(actual, expected):
            assert actual == expected  # pytest shows the difference


def cases(name: str) -> Any:
    """Return a decorator that runs a test with each case of a transcript in tests/messages, as its argument `case`."""
    path = FOLDER / name
    _, *texts = f"\n{path.read_text('utf-8')}".split(f"\n{_TITLE}")
    found = [_parse(path, text) for text in texts]
    assert len({case.title for case in found}) == len(found) > 0, name
    return pytest.mark.parametrize("case", found, ids=str)


def _parse(path: Path, text: str) -> Case:
    title, *lines = text.rstrip("\n").split("\n")
    return Case(path, title, tuple(lines))


def _steps(lines: tuple[str, ...]) -> Iterator[list[str]]:
    """Split the lines of a case at its edits and commands."""
    starts = [number for number, line in enumerate(lines) if line.startswith((_EDIT, _COMMAND))]
    assert starts and starts[0] == 0, lines
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        yield list(lines[start:end])


def _run(step: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """Run a step, an edit or a command, and return its lines in the transcript with the output."""
    if step[0].startswith(_EDIT):
        _edit(Path(step[0].removeprefix(_EDIT)), step[1:])
        return "".join(f"{line}\n" for line in step)
    program, *arguments = shlex.split(step[0].removeprefix(_COMMAND))
    if program == "hsplat":
        capsys.readouterr()
        code = main.run(arguments)
        printed = "".join(capsys.readouterr()).replace(str(Path.cwd()), "/folder")
    else:
        code, printed = 0, _COMMANDS[program](*map(Path, arguments)) or ""
    end = "" if printed.endswith("\n") or not printed else "\n"
    return f"{step[0]}\n{printed}{end}" + (f"[{code}]\n" if code else "")


def _list(folder: Path) -> str:
    if not folder.exists():
        return f"{folder}: does not exist"
    return "".join(f"{path.name}{'/' * path.is_dir()}\n" for path in sorted(folder.iterdir()))


def _compare(one: Path, other: Path) -> str:
    return "" if one.read_bytes() == other.read_bytes() else f"{one} {other} differ"


_COMMANDS: dict[str, Callable[..., Any]] = {
    "ls": _list,
    "touch": Path.touch,
    "cat": lambda path: path.read_text("utf-8"),
    "rm": Path.unlink,
    "cp": lambda one, other: other.write_bytes(one.read_bytes()) and None,
    "mv": lambda one, other: one.rename(other) and None,
    "cmp": _compare,
}


def _edit(path: Path, lines: list[str]) -> None:
    old, new = ([line[2:] for line in lines if line[:1] == sign] for sign in "-+")
    assert len(old) + len(new) == len(lines), lines
    if not old:
        path.write_text("".join(f"{line}\n" for line in new), "utf-8")
        return
    text = path.read_text("utf-8")
    assert text.count("\n".join(old)) == 1, f"{path}: not there once: {old}"
    path.write_text(text.replace("\n".join(old), "\n".join(new)), "utf-8")


def _matches(actual: str, expected: str) -> bool:
    return re.fullmatch(re.escape(expected).replace(re.escape("..."), ".*"), actual, re.DOTALL) is not None
