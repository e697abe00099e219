"""The files that a scene in plain data names: where they are, for one who reads it from a file in some folder."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from renderer.scene.schema import is_file_name

# Keys of a scene whose texts name files.
_FILE_KEYS = ("file", "import", "names", "font", "logo")
_ONE_UP = f"{os.pardir}{os.sep}"
_UP = re.compile(f"(?:{re.escape(_ONE_UP)})+")


def relative_path(file: str | os.PathLike[str], folder: str | os.PathLike[str]) -> str:
    """Return the path of a file for one who stands in a folder, through any links on the way to both.

    A link that the file itself is stays one.
    """
    parent, name = os.path.split(os.fspath(file))
    is_place = name in ("", os.curdir, os.pardir)
    real = os.path.realpath(file) if is_place else os.path.join(os.path.realpath(parent), name)
    return os.path.relpath(real, os.path.realpath(folder))


def found_path(name: str, folder: str | os.PathLike[str]) -> str:
    """Return the path of a file that has this name for one who stands in a folder, without `..` at its beginning."""
    if (up := _UP.match(name)) is None:
        return os.path.join(folder, name)
    above = Path(os.path.realpath(folder)).parents
    num_up = min(up.end() // len(_ONE_UP), len(above))
    return os.path.join(above[num_up - 1] if num_up else os.sep, name[up.end() :])


def with_files(part: Any, place: Callable[[str, str], str]) -> Any:
    """Return a part of a scene in plain data in which its files have other names.

    place: returns the new name of a file, from its key and its name.
    """

    def moved(key: str, item: Any) -> Any:
        if key in _FILE_KEYS and is_file_name(item):
            return place(key, item)
        if key in _FILE_KEYS and isinstance(item, (list, tuple)):
            return [moved(key, each) for each in item]
        return with_files(item, place)

    if isinstance(part, dict):
        return {key: moved(key, item) for key, item in part.items()}
    return [with_files(item, place) for item in part] if isinstance(part, (list, tuple)) else part
