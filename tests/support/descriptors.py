"""The files and pipes that this process has open, as far as a test has opened them.

Other threads of the process open and close files of their own at any time: the number of all descriptors says nothing.
"""

from __future__ import annotations

import os
from pathlib import Path

_DESCRIPTORS = Path("/proc/self/fd")

# The beginnings of the targets of descriptors that are no files of a folder.
_UNNAMED = ("pipe:", "socket:", "/memfd:")


def open_files(folder: Path) -> list[str]:
    """Returns the open files below `folder`, deleted ones as well."""
    return [target for target in _targets() if target.startswith(f"{folder}/")]


def open_unnamed() -> set[str]:
    """Returns the open pipes, sockets and files without a name; empty on a system that does not list them."""
    return {target for target in _targets() if target.startswith(_UNNAMED) or target.endswith(" (deleted)")}


def _targets() -> list[str]:
    if not _DESCRIPTORS.is_dir():
        return []
    targets = []
    for descriptor in os.listdir(_DESCRIPTORS):
        try:
            targets.append(os.readlink(_DESCRIPTORS / descriptor))
        except FileNotFoundError:  # closed since it was listed, as the one of the listing itself
            continue
    return targets
