"""Read the files that a command is given, up to a largest size: scenes in YAML, sidecars in JSON."""

from __future__ import annotations

import json
import os
import re
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from renderer.errors import InputError, closest_match

MAX_SCENE_BYTES = 2**20
# The largest size of a sidecar, in bytes. The longest film has a million frames, and a sidecar has some 500 bytes for
# each frame.
MAX_SIDECAR_BYTES = 2**29

_VOLUME_HINT = "a volume is rendered with `hsplat turntable FILE`, or with `hsplat render SCENE --volume FILE`"
_UTF16 = (b"\xff\xfe", b"\xfe\xff")
# The text headers of volumes: the first bytes of NRRD and VTK, or a line that every MetaImage header has.
_VOLUME_HEADER = re.compile(rb"\A(?:NRRD000|# vtk DataFile)|^ElementDataFile[ \t]*=", re.IGNORECASE | re.MULTILINE)

# A part of the target of every link that git-annex makes for a file that it manages.
_ANNEX = ".git/annex/objects/"

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def require_file(path: Path, expected: str) -> None:
    """Raise InputError for a broken link, and for anything but a regular file: opening a pipe would block."""
    if os.path.islink(path) and not os.path.exists(path):
        raise missing_file_error(path)
    if os.path.exists(path) and not os.path.isfile(path):
        got = "a folder" if os.path.isdir(path) else "a special file"
        raise InputError("not a file", where=str(path), got=got, expected=expected)


def read_bounded(path: Path, max_bytes: int, what: str) -> bytes:
    """Return the content of a file of at most `max_bytes`. Raises InputError for a larger or unreadable file.

    what: the expected kind of file, for messages.
    """
    with _open(path, what) as file:
        content = file.read(max_bytes + 1)
    if len(content) > max_bytes:
        raise InputError(f"too large for {what}", where=str(path), expected=f"at most {max_bytes} bytes")
    return content


def read_content(path: Path) -> bytes:
    """Return the content of a scene file or a sidecar. A file that is too large is cut to one byte more than allowed.

    Raises InputError if the file cannot be read.
    """
    with _open(path, "a scene file") as file:
        content = file.read(MAX_SCENE_BYTES + 1)
        return content + file.read(MAX_SIDECAR_BYTES - MAX_SCENE_BYTES) if may_be_json(content) else content


@contextmanager
def _open(path: Path, what: str) -> Iterator[BinaryIO]:
    try:
        with path.open("rb") as file:
            yield file
    except FileNotFoundError as error:
        raise missing_file_error(path) from error
    except IsADirectoryError as error:
        raise InputError("a folder", where=str(path), expected=what) from error
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else None
        raise InputError(f"cannot be read: {reason or error}", where=str(path)) from error


def read_json_object(path: Path, max_bytes: int) -> dict[str, Any] | None:
    """Return the JSON object in a regular file of at most `max_bytes`; None for anything else."""
    try:
        if not path.is_file() or path.stat().st_size > max_bytes:
            return None
        data = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    return data if isinstance(data, dict) else None


def may_be_json(content: bytes) -> bool:
    """Return whether a file with this beginning may hold a JSON object."""
    return content.removeprefix(_BYTE_ORDER_MARK).lstrip(b" \t\r\n").startswith(b"{")


def decode_utf8(content: bytes, path: Path) -> str:
    """Return the text of a UTF-8 file. Raises InputError with the line of the first wrong byte."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(
            "not a text file in UTF-8",
            where=f"{path}:{line}",
            got=f"the byte 0x{content[error.start]:02x}",
            hint=_VOLUME_HINT if b"\0" in content and not content.startswith(_UTF16) else "save it in UTF-8",
        ) from error


def reject_volume_header(content: bytes, path: Path) -> None:
    """Raise InputError if a file is the text header of a volume and not a scene."""
    if b"\0" not in content and _VOLUME_HEADER.search(content):
        raise InputError("a volume, not a scene", where=str(path), expected="a scene file", hint=_VOLUME_HINT)


def is_same_file(path: Path, other: Path) -> bool:
    """Return whether both paths exist and lead to one file, through any links and folders."""
    try:
        return os.path.samefile(path, other)
    except (OSError, ValueError):
        return False


def place_of(path: str | Path) -> str:
    """Return a path in a form that can be compared with others: links are resolved, and letters are lower case.

    Files and folders on the path need not exist yet.

    Paths that differ only in case, or in the encoding of accents, become equal, as they are one file on some disks.
    """
    return place_name(os.path.realpath(path))


def place_name(name: str) -> str:
    """Return a name in a form that can be compared with others: in lower case, with accents in one encoding."""
    return unicodedata.normalize("NFC", name).lower()


def missing_file_error(path: Path, what: str = "no such file") -> InputError:
    """Return the error for a missing file, with a similar name or, for a broken link, the link's target."""
    if path.is_symlink():
        target = os.readlink(path)
        if _ANNEX in target.replace("\\", "/"):
            what, hint = "a link of git-annex to a file that is not here", f"`git annex get {path.name}` fetches it"
            return InputError(what, where=str(path), hint=hint)
        return InputError("a broken link", where=str(path), got=target)
    return InputError(what, where=str(path), hint=nearest_file_hint(path))


def nearest_file_hint(path: Path) -> str | None:
    """Return a hint with the most similar name of a file in the same folder; None if no name is similar."""
    try:
        names = sorted(entry.name for entry in path.parent.iterdir())
    except OSError:
        return None
    close = closest_match(path.name, names)
    return f"did you mean {path.with_name(close)}?" if close else None
