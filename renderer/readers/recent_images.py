"""Keep the images that were read last, so that a step in time that is asked for again is not decoded again."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Hashable
from pathlib import Path

from renderer.readers.image import Image

# Of each file its name, number, size and time.
FileMarks = tuple[tuple[str, int, int, int], ...]


class RecentImages:
    """A store of images by the arguments of their reader. Threads may share it.

    most_bytes: the most that the voxels of all images take. The image that was not used for the longest time goes
    first, and one that is larger than all of it is not kept.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._images: dict[Hashable, Image] = {}
        self._lock = threading.Lock()

    def get(self, key: Hashable, read: Callable[[], Image]) -> Image:
        """Return the image of a key: the one that is kept, or else what `read` returns. Its values are read-only."""
        with self._lock:
            found = self._images.pop(key, None)
            if found is not None:
                self._images[key] = found  # now the last to go
                return found
        image = read()
        image.values.flags.writeable = False
        with self._lock:
            self._images[key] = image
            while sum(each.values.nbytes for each in self._images.values()) > self._most_bytes:
                del self._images[next(iter(self._images))]
        return image


def marks_of(path: Path) -> FileMarks:
    """Return what changes when a file, or one in a folder, changes: names, sizes and times."""
    files = [entry for entry in os.scandir(path) if entry.is_file()] if path.is_dir() else [path]
    states = [(file.name, file.stat()) for file in files]
    return tuple(sorted((name, state.st_ino, state.st_size, state.st_mtime_ns) for name, state in states))
