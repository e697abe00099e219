"""Find and change the names of files in the plain data of a scene; names are relative to the scene file's folder."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from renderer.scene.schema import is_file_name
from renderer.scene.urls import is_url

# The keys of a scene whose values are names of files.
_FILE_KEYS = ("file", "import", "names", "font", "logo")
_ONE_UP = f"{os.pardir}{os.sep}"
_UP = re.compile(f"(?:{re.escape(_ONE_UP)})+")


def relative_path(file: str | os.PathLike[str], folder: str | os.PathLike[str]) -> str:
    """Return the path of a file relative to a folder, after all links to folders are resolved; a URL stays.

    If the file itself is a link, the path is that of the link.
    """
    if is_url(file):
        return str(file)
    parent, name = os.path.split(os.fspath(file))
    is_place = name in ("", os.curdir, os.pardir)
    real = os.path.realpath(file) if is_place else os.path.join(os.path.realpath(parent), name)
    return os.path.relpath(real, os.path.realpath(folder))


def found_path(name: str, folder: str | os.PathLike[str]) -> str:
    """Return the path of a file from its name relative to a folder; a URL stays.

    Each `..` at the beginning of the name leads to the parent of the folder to which all links have been followed.
    """
    if is_url(name):
        return name
    if (up := _UP.match(name)) is None:
        return os.path.join(folder, name)
    above = Path(os.path.realpath(folder)).parents
    num_up = min(up.end() // len(_ONE_UP), len(above))
    return os.path.join(above[num_up - 1] if num_up else os.sep, name[up.end() :])


def with_files(part: Any, place: Callable[[str, str], str]) -> Any:
    """Return a copy of a part of a scene's plain data, with new names of its files; URLs stay.

    place: a function that returns the new name of a file from the file's key and its old name.
    """

    def moved(key: str, item: Any) -> Any:
        if is_url(item):
            return item
        if key in _FILE_KEYS and is_file_name(item):
            return place(key, item)
        if key in _FILE_KEYS and isinstance(item, (list, tuple)):
            return [moved(key, each) for each in item]
        return with_files(item, place)

    if isinstance(part, dict):
        return {key: moved(key, item) for key, item in part.items()}
    return [with_files(item, place) for item in part] if isinstance(part, (list, tuple)) else part
