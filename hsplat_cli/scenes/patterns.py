"""Names of files on a command line that may be patterns, which the shell has not expanded."""

from __future__ import annotations

import glob
from pathlib import Path

from renderer.errors import InputError


def expand_pattern(name: str) -> list[Path]:
    """What a pattern such as `scans/**/*.nrrd` matches, sorted; any other name, or one that is there, as it is.

    Raises InputError for a pattern that matches nothing.
    """
    if Path(name).exists() or not glob.has_magic(name):
        return [Path(name)]
    found = sorted(glob.glob(name, recursive=True))
    if not found:
        hint = None if Path(name).is_absolute() else f"it is relative to {Path.cwd()}"
        raise InputError("no file matches this pattern", where=name, hint=hint)
    return [Path(path) for path in found]
