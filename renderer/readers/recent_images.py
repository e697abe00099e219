"""Keep the images that were read last, so that a repeated request for a step in time does not decode it again."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Hashable
from pathlib import Path

from renderer.readers.image import Image

# The name, inode number, size and modification time of each file.
FileMarks = tuple[tuple[str, int, int, int], ...]


class RecentImages:
    """A cache of images under the arguments of their reader, which threads may share.

    most_bytes: the most bytes of the voxels of all images. The least recently used image is dropped first, and an image
    with more bytes than that is not kept.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._images: dict[Hashable, Image] = {}
        self._lock = threading.Lock()

    def get(self, key: Hashable, read: Callable[[], Image]) -> Image:
        """Return the kept image of a key, or else read it and keep it. Its values are read-only."""
        with self._lock:
            found = self._images.pop(key, None)
            if found is not None:
                self._images[key] = found  # now the most recently used one
                return found
        image = read()
        image.values.flags.writeable = False
        with self._lock:
            self._images[key] = image
            while sum(each.values.nbytes for each in self._images.values()) > self._most_bytes:
                del self._images[next(iter(self._images))]
        return image


def marks_of(path: Path) -> FileMarks:
    """Return the marks of a file, or of all files in a folder; they change when a file changes."""
    files = [entry for entry in os.scandir(path) if entry.is_file()] if path.is_dir() else [path]
    states = [(file.name, file.stat()) for file in files]
    return tuple(sorted((name, state.st_ino, state.st_size, state.st_mtime_ns) for name, state in states))
