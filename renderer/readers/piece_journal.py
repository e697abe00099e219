"""Remember which pieces of a volume were read into a file, so that a later process goes on where one was ended."""

from __future__ import annotations

import json
import zlib
from contextlib import suppress
from pathlib import Path

import numpy as np

from renderer.volume import Array


class PieceJournal:
    """A list of pieces of a volume with checksums of their voxels, in a file to which a line is added for each piece.

    A kill may leave half a line, and a power failure a line of voxels that are not on the disk; such a piece counts as
    not read. Threads may share a journal.
    """

    def __init__(self, file: Path) -> None:
        """Open a journal, which may have lines. Raises OSError."""
        self._file = file.open("ab", buffering=0)
        self._known: dict[str, int] = {}
        for line in file.read_bytes().split(b"\n"):
            with suppress(ValueError, TypeError):
                name, checksum = json.loads(line)
                self._known[str(name)] = int(checksum)

    def has(self, name: str, voxels: Array) -> bool:
        """Return whether a piece was read, and its voxels are still those that were read."""
        return name in self._known and self._known[name] == _checksum(voxels)

    def add(self, name: str, voxels: Array) -> None:
        """Add a piece, whose voxels are in the file of the volume. Raises OSError."""
        self._file.write(b"\n" + json.dumps([name, _checksum(voxels)]).encode("ascii") + b"\n")


def _checksum(voxels: Array) -> int:
    return zlib.crc32(np.ascontiguousarray(voxels).reshape(-1).view(np.uint8).data)
