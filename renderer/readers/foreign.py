"""Recognise files of foreign formats by their first bytes or the ends of their names, and raise an error with a hint.

`foreign.tsv` has a line for each format: its name, a pattern of its first bytes, ends of file names, and a hint, where
`FILE` stands for the file's name. Where a line has a pattern and ends of names, a file must match both. The first line
that matches a file is used.
"""

from __future__ import annotations

import json
import os
import re
from functools import cache
from itertools import islice
from pathlib import Path

from renderer.errors import InputError
from renderer.scene import short_text

# The files that describe an array of Zarr, of version 2 or 3. In version 3, the file may also describe a group.
_ZARR_ARRAYS = (".zarray", "zarr.json")
# The largest number of folders in which an array of Zarr is searched for.
_MAX_ZARR_FOLDERS = 1000
# The largest number of bytes of the description of a Zarr array that are read.
_MAX_ZARR_BYTES = 2**20
# A file name that needs no escapes between quotes, in a shell or in Python.
_PLAIN_NAME = re.compile(r"[\w .+-]{1,200}")
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


def refuse_zarr(path: Path) -> None:
    """Raise InputError for a Zarr folder; the hint names its first array."""
    if not any((path / name).is_file() for name in (*_ZARR_ARRAYS, ".zgroup")):
        return
    array = _first_array(path)
    if array is None:
        raise _foreign(path, "a Zarr array or group", "no array was found in it: name the folder of one")
    place = (Path("FILE") / array.relative_to(path)).as_posix()
    command = f"import numpy, zarr; numpy.save('volume.npy', zarr.open('{short_text(place)}', mode='r')[:])"
    raise _foreign(path, "a Zarr array or group", f'`python -c "{command}"`')


def _first_array(folder: Path) -> Path | None:
    """Return the Zarr array that is the fewest levels below a folder, or the folder itself; None if there is none."""
    num_left, folders = _MAX_ZARR_FOLDERS, [folder]
    while folders and num_left > 0:
        num_left -= len(folders)
        found = next((each for each in folders if _is_zarr_array(each)), None)
        if found is not None:
            return found
        folders = [below for each in folders for below in _folders_in(each)]
    return None


def _folders_in(folder: Path) -> list[Path]:
    """Return the first folders in a folder, short names first; links and names that need escapes are left out."""
    with os.scandir(folder) as entries:
        names = [each.name for each in islice(entries, _MAX_ZARR_FOLDERS) if each.is_dir(follow_symlinks=False)]
    return [folder / name for name in sorted(names, key=lambda name: (len(name), name)) if _PLAIN_NAME.fullmatch(name)]


def _is_zarr_array(folder: Path) -> bool:
    if (folder / ".zarray").is_file():
        return True
    try:
        with (folder / "zarr.json").open("rb") as file:
            return bool(dict(json.loads(file.read(_MAX_ZARR_BYTES))).get("node_type") == "array")
    except (OSError, ValueError, TypeError, RecursionError):
        return False


def compressed_error(path: Path, content: str) -> InputError:
    """Return the error for a gzip file whose format is only read without gzip. content: the name of that format."""
    return _foreign(path, f"{content}, compressed by gzip", "`gunzip FILE` unpacks it")


def _foreign(path: Path, what: str, hint: str) -> InputError:
    shown = hint.replace("FILE", short_text(path.name))
    return InputError(f"this is {what}, which is not read", where=str(path), hint=shown)
