"""Keep the images that were read last, so that a volume or a step in time that is needed again is not decoded again."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from pathlib import Path

from renderer.readers.image import Image
from renderer.volume import backing_file

# The marks of files, by which a change is noticed: the name, inode number, size and modification time of each file.
FileMarks = tuple[tuple[str, int, int, int], ...]


@dataclass(frozen=True)
class ImageRequest:
    """A request for an image of a file.

    source: the volume that the file belongs to, perhaps as one of many steps in time.
    choice: the file, and the arguments of its reader.
    marks: the marks of all files that the image depends on; they change when a file changes.
    """

    source: Hashable
    choice: Hashable
    marks: tuple[FileMarks, ...]


class RecentImages:
    """A cache of images, which threads may share.

    A new image takes the place of images of other sources, the least recently used one first. It never takes the place
    of an image of its own source: a film asks for all its steps several times, in the same order, and each step would
    be dropped just before it is needed again. An image that finds no place is not kept, nor are voxels that stay in
    their file, whose pages the system keeps.

    most_bytes: a function that returns how many bytes the voxels of all images on disk, or of all images in memory, may
        take together; it is called with whether they are on disk.
    """

    def __init__(self, most_bytes: Callable[[bool], float]) -> None:
        self._most_bytes = most_bytes
        self._images: dict[Hashable, tuple[ImageRequest, Image]] = {}
        self._lock = threading.Lock()

    def get(self, request: ImageRequest, read: Callable[[], Image]) -> Image:
        """Return the kept image of a request, or else read it and keep it. Its values are read-only."""
        found = self.find(request)
        return self.keep(request, read()) if found is None else found

    def find(self, request: ImageRequest) -> Image | None:
        """Return the kept image of a request; None if it is not kept."""
        with self._lock:
            kept = self._images.pop(request.choice, None)
            if kept is None or kept[0].marks != request.marks:
                return None
            self._images[request.choice] = request, kept[1]  # now the most recently used one
            return kept[1]

    def keep(self, request: ImageRequest, image: Image) -> Image:
        """Keep the image of a request, if there is room for it, in place of an earlier one. Return it, read-only."""
        image.values.flags.writeable = False
        if image.is_on_disk or backing_file(image.values) is None:
            with self._lock:
                self._images.pop(request.choice, None)
                self._keep(request, image)
        return image

    def drop(self, request: ImageRequest) -> None:
        """Keep the image of a request no longer."""
        with self._lock:
            self._images.pop(request.choice, None)

    def _keep(self, request: ImageRequest, image: Image) -> None:
        most_bytes = self._most_bytes(image.is_on_disk) - image.values.nbytes
        others = [
            choice
            for choice, (kept, other) in self._images.items()
            if kept.source != request.source and other.is_on_disk == image.is_on_disk
        ]
        while others and self._num_bytes(image.is_on_disk) > most_bytes:
            del self._images[others.pop(0)]
        if self._num_bytes(image.is_on_disk) <= most_bytes:
            self._images[request.choice] = request, image

    def _num_bytes(self, is_on_disk: bool) -> int:
        images = (image for _, image in self._images.values())
        return sum(image.values.nbytes for image in images if image.is_on_disk == is_on_disk)


def marks_of(path: Path) -> FileMarks:
    """Return the marks of a file, or of all files in a folder; they change when a file changes."""
    files = [entry for entry in os.scandir(path) if entry.is_file()] if path.is_dir() else [path]
    states = [(file.name, file.stat()) for file in files]
    return tuple(sorted((name, state.st_ino, state.st_size, state.st_mtime_ns) for name, state in states))
