"""The content of a file that a command is told to work on: a scene in YAML, or a sidecar in JSON."""

from __future__ import annotations

import os
import re
from pathlib import Path

from renderer.errors import InputError, closest_match

MAX_SCENE_BYTES = 2**20
# The longest film that a scene can ask for has a million frames, and a sidecar some 500 bytes for each.
MAX_SIDECAR_BYTES = 2**29

_VOLUME_HINT = "a volume is rendered with `hsplat turntable FILE`, or with `hsplat render SCENE --volume FILE`"
_UTF8_HINT = "save it in UTF-8"
_UTF16 = (b"\xff\xfe", b"\xfe\xff")
# How the headers of NRRD and VTK begin, and a line without which MetaImage has none.
_VOLUME_HEADER = re.compile(rb"NRRD000|# vtk DataFile|(?:.*\n)*?ElementDataFile[ \t]*=", re.IGNORECASE)

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def read_content(path: Path) -> bytes:
    """What is in a file, or so much of it that it shows to be too large. Raises InputError."""
    try:
        with path.open("rb") as file:
            content = file.read(MAX_SCENE_BYTES + 1)
            if may_be_json(content):
                content += file.read(MAX_SIDECAR_BYTES - MAX_SCENE_BYTES)
            return content
    except FileNotFoundError as error:
        raise InputError("no such file", where=str(path), hint=nearest_file_hint(path)) from error
    except IsADirectoryError as error:
        raise InputError("a folder", where=str(path), expected="a scene file") from error
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        raise InputError(f"cannot be read: {reason or error}", where=str(path)) from error


def may_be_json(content: bytes) -> bool:
    """Whether a file that begins like this may hold an object of JSON."""
    return content.removeprefix(_BYTE_ORDER_MARK).lstrip(b" \t\r\n").startswith(b"{")


def decode_utf8(content: bytes, path: Path) -> str:
    """The text that a file holds in UTF-8. Raises InputError."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(
            "not a text file in UTF-8",
            where=f"{path}:{line}",
            got=f"the byte 0x{content[error.start]:02x}",
            hint=_VOLUME_HINT if b"\0" in content and not content.startswith(_UTF16) else _UTF8_HINT,
        ) from error


def reject_volume_header(content: bytes, path: Path) -> None:
    """Raise InputError for the header of a volume, which is text, in the place of a scene."""
    if b"\0" not in content and _VOLUME_HEADER.match(content):
        raise InputError("a volume, not a scene", where=str(path), expected="a scene file", hint=_VOLUME_HINT)


def is_same_file(path: Path, other: Path) -> bool:
    """Whether both names are there and lead to one file, whatever links and folders are on the way."""
    try:
        return os.path.samefile(path, other)
    except (OSError, ValueError):
        return False


def nearest_file_hint(path: Path) -> str | None:
    """A hint that names another file of nearly this name, or None; just this name has a link to nothing."""
    try:
        names = sorted({entry.name for entry in path.parent.iterdir()} - {path.name})
    except OSError:
        return None
    close = closest_match(path.name, names)
    return f"did you mean {path.with_name(close)}?" if close else None
