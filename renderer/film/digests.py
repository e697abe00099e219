"""Compute digests of files and records: 32 hexadecimal digits, which differ if the contents differ."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from renderer.scene import PictureKind

# A file is read in blocks of this many bytes.
_BLOCK_BYTES = 2**20


def bytes_digest(content: bytes) -> str:
    """Return the digest of some bytes: 32 hexadecimal digits."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def data_digest(data: Any) -> str:
    """Return the digest of plain data, such as a record, whatever the order of its keys."""
    return bytes_digest(json.dumps(data, sort_keys=True).encode())


def file_digest(path: Path) -> str:
    """Return the digest of a file of any size. Raises OSError."""
    found = hashlib.blake2b(digest_size=16)
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK_BYTES):
            found.update(block)
    return found.hexdigest()


def file_matches_digest(path: Path, expected: str | None) -> bool:
    """Return whether a file exists and has the expected digest."""
    try:
        return path.is_file() and file_digest(path) == expected
    except OSError:
        return False


def frame_matches_digest(path: Path, expected: str | None, kind: PictureKind) -> bool:
    """Return whether a frame's file exists, and has the expected digest and a picture of the given kind."""
    from renderer.film.picture import picture_layout  # imports numpy, which the other functions do not need

    try:
        content = path.read_bytes() if path.is_file() else b""
        return bytes_digest(content) == expected and picture_layout(content) == (kind.shape, kind.depth)
    except (OSError, ValueError):
        return False
