"""Name files that are not read for what they are, by their first bytes or the ends of their names, and what to do.

`foreign.tsv` has a line for each kind: what it is, a pattern of how it begins, ends of names, and a hint, where `FILE`
stands for the file's name. A kind with a pattern and ends of names has both. The first that fits counts.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from renderer.errors import InputError
from renderer.scene import short_text

# How pointers begin; the first bytes tell of which kind they are.
_POINTERS = (b"version https://git-lfs", b"/annex/objects/")
_POINTER_BYTES = 64

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
    """Raise InputError for a file that begins as one of a known kind that is not read."""
    for what, pattern, ends, hint in _kinds():
        if pattern and pattern.match(start) and (not ends or path.name.lower().endswith(ends)):
            raise _foreign(path, what, hint)


def refuse_pointer(path: Path) -> None:
    """Raise InputError for a small text in place of a file, as git-lfs and git-annex keep it until it is fetched."""
    with path.open("rb") as file:
        start = file.read(_POINTER_BYTES)
    if start.startswith(_POINTERS):
        refuse_bytes(path, start)


def refuse_name(path: Path) -> None:
    """Raise InputError for a file whose name alone tells a kind that is not read."""
    for what, pattern, ends, hint in _kinds():
        if pattern is None and path.name.lower().endswith(ends):
            raise _foreign(path, what, hint)


def refuse_zarr(path: Path) -> None:
    """Raise InputError for a folder of Zarr."""
    if any((path / name).is_file() for name in (".zarray", ".zgroup", "zarr.json")):
        hint = "`python -c \"import numpy, zarr; numpy.save('volume.npy', zarr.open('FILE/0', mode='r')[:])\"`"
        raise _foreign(path, "a Zarr array or group", hint)


def compressed_error(path: Path, content: str) -> InputError:
    """Return the error for gzip around what is read without it only. content: what that is, or is not known to be."""
    return _foreign(path, f"{content}, compressed by gzip", "`gunzip FILE` unpacks it")


def _foreign(path: Path, what: str, hint: str) -> InputError:
    shown = hint.replace("FILE", short_text(path.name))
    return InputError(f"this is {what}, which is not read", where=str(path), hint=shown)
