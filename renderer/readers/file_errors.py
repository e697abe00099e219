"""Report files that cannot be read: missing, empty, damaged, or refused by a library.

A reader may raise errors without a place. `errors_about` adds the file that is read.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from renderer.errors import InputError
from renderer.scene import missing_file_error, short_text

# The type of a label in the results of `labels_or_note`.
T = TypeVar("T")


def require_exists(path: Path) -> Path:
    """Return the path. Raises InputError if it does not exist, is empty, or may not be read."""
    if path.exists():
        if not os.access(path, os.R_OK):
            raise InputError("no permission to read this", where=str(path))
        if not (path.is_file() or path.is_dir()):
            raise InputError("this is neither a file nor a folder", where=str(path))
        if path.is_file() and path.stat().st_size == 0:  # special files have the size 0, too, and may block reading
            raise InputError("an empty file", where=str(path))
        return path
    raise missing_file_error(path, "no such file or folder")


def labels_or_note(read: Callable[[], tuple[T, ...]]) -> tuple[tuple[T, ...], str | None]:
    """Return the labels that a file describes, or no labels and a note if they cannot be read."""
    try:
        return read(), None
    except InputError as error:
        return (), f"the labels in this file are left out: {error.what} ({error.where})"


@contextmanager
def errors_about(where: Path | str) -> Iterator[None]:
    """Add a place, such as the file that is read, to errors from inside the `with` block that have no place."""
    try:
        yield
    except InputError as error:
        error.where = error.where or str(where)
        raise


def damaged_error(what: str, got: str | None = None, expected: str | None = None) -> InputError:
    """Return the error for a truncated or damaged file. what: the sentence that states the damage."""
    return InputError(what, got=got, expected=expected, hint="the file is truncated or damaged")


def unreadable_error(error: Exception) -> InputError:
    """Return the error of an operating system or a library as an InputError, on one line."""
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    shown = short_text(" ".join(text.split())) or type(error).__name__
    return InputError("cannot read this file", got=shown)
