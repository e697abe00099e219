"""Recognise files of foreign formats by their first bytes or the ends of their names, and raise an error with a hint.

`foreign.tsv` has a line for each format: its name, a pattern of its first bytes, ends of file names, and a hint, where
`FILE` stands for the file's name. Where a line has a pattern and ends of names, a file must match both. The first line
that matches a file is used.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from renderer.errors import InputError
from renderer.scene import short_text

# The first bytes of pointers: short texts that git-lfs or git-annex keeps in place of a file.
_POINTERS = (b"version https://git-lfs", b"/annex/objects/")
# The number of bytes that are read to recognise a pointer.
_POINTER_BYTES = 64

# A line of `foreign.tsv`: the name of a format, its pattern, ends of file names, and a hint.
_Kind = tuple[str, "re.Pattern[bytes] | None", tuple[str, ...], str]


@cache
def _kinds() -> tuple[_Kind, ...]:
    lines = Path(__file__).with_name("foreign.tsv").read_text("utf-8").splitlines()
    rows = (line.split("\t") for line in lines[1:])
    return tuple(
        (what, re.compile(begin.encode("ascii"), re.DOTALL) if begin else None, tuple(ends.split()), hint)
        for what, begin, ends, hint in rows
    )


def refuse_bytes(path: Path, start: bytes) -> None:
    """Raise InputError for a file that begins like a known foreign format."""
    for what, pattern, ends, hint in _kinds():
        if pattern and pattern.match(start) and (not ends or path.name.lower().endswith(ends)):
            raise _foreign(path, what, hint)


def refuse_pointer(path: Path) -> None:
    """Raise InputError for a pointer, the short text that git-lfs or git-annex keeps until the file is fetched."""
    with path.open("rb") as file:
        start = file.read(_POINTER_BYTES)
    if start.startswith(_POINTERS):
        refuse_bytes(path, start)


def refuse_name(path: Path) -> None:
    """Raise InputError for a file whose name alone shows a known foreign format."""
    for what, pattern, ends, hint in _kinds():
        if pattern is None and path.name.lower().endswith(ends):
            raise _foreign(path, what, hint)


def compressed_error(path: Path, content: str) -> InputError:
    """Return the error for a gzip file whose format is only read without gzip. content: the name of that format."""
    return _foreign(path, f"{content}, compressed by gzip", "`gunzip FILE` unpacks it")


def _foreign(path: Path, what: str, hint: str) -> InputError:
    shown = hint.replace("FILE", short_text(path.name))
    return InputError(f"this is {what}, which is not read", where=str(path), hint=shown)
