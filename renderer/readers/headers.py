"""Where the voxels of a NRRD or MetaImage file are: the few header fields that say so.

SimpleITK reads both formats; it reports a missing data file as an unreadable header and takes the memory that a header
asks for before it looks at the file. These functions find the data first.

NRRD: http://teem.sourceforge.net/nrrd/format.html. MetaImage: https://itk.org/Wiki/ITK/MetaIO/Documentation.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from renderer.errors import InputError
from renderer.readers.common import existing

# No header comes near this; a file without the end-of-header mark is not read whole in search of it.
_MAX_HEADER_BYTES = 2**20


@dataclass(frozen=True)
class StoredVoxels:
    """`num_bytes` of voxel data in `file`, compressed by deflate or not."""

    file: Path
    num_bytes: int
    compressed: bool


def nrrd_voxels(path: Path) -> StoredVoxels | None:
    """The data of a NRRD file; None when it is text, bzip2 or spread over several files, which its reader checks.

    Raises InputError for a data file that is not there.
    """
    header, separator, _ = _head(path).replace(b"\r\n", b"\n").partition(b"\n\n")
    fields = _fields(header, ":")
    encoding = fields.get("encoding", "raw").lower()
    name = fields.get("data file") or fields.get("datafile")
    lines_skipped = fields.get("line skip") or fields.get("lineskip") or "0"
    if name is None:
        stored = StoredVoxels(path, path.stat().st_size - len(header) - len(separator), encoding != "raw")
    elif name.split()[0] == "LIST" or "%" in name:
        return None
    else:
        stored = _detached(path, name, encoding != "raw")
    return stored if encoding in ("raw", "gzip", "gz") and lines_skipped == "0" else None


def metaimage_voxels(path: Path) -> StoredVoxels | None:
    """The data of a MetaImage file; None when it is text or spread over several files, which its reader checks.

    Raises InputError for a data file that is not there, and for a compressed one that is shorter than the header says.
    """
    head = _head(path)
    start = head.find(b"\n", head.find(b"ElementDataFile")) + 1
    fields = _fields(head[:start], "=")
    name = fields.get("elementdatafile", "LOCAL")
    compressed = fields.get("compresseddata", "False").lower() in ("true", "1")
    if name.split()[0] == "LIST" or "%" in name:
        return None
    if name.upper() == "LOCAL":
        stored = StoredVoxels(path, path.stat().st_size - start, compressed)
    else:
        stored = _detached(path, name, compressed)
    declared = fields.get("compresseddatasize", "")
    if compressed and declared.isdigit() and stored.num_bytes < int(declared):
        raise InputError(
            "the file is shorter than its header says",
            where=str(stored.file),
            got=f"{stored.num_bytes} bytes of compressed data",
            expected=f"{declared} bytes",
            hint="the file is truncated or its header is wrong",
        )
    return stored if fields.get("binarydata", "True").lower() in ("true", "1") else None


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_MAX_HEADER_BYTES)


def _fields(header: bytes, mark: str) -> dict[str, str]:
    """`key: value` or `key = value` lines, keys in lower case."""
    fields = {}
    for line in header.decode("latin-1").splitlines():
        key, found, value = line.partition(mark)
        if found and value.strip() and not line.startswith("#"):
            fields[key.strip().lower()] = value.strip()
    return fields


def _detached(header: Path, name: str, compressed: bool) -> StoredVoxels:
    file = header.parent / name
    if not file.is_file():
        raise InputError(
            "the data file that this header names is not there",
            where=str(header),
            got=name,
            expected=f"a file {file}",
            hint="the two belong together: move or copy both",
        )
    return StoredVoxels(existing(file), file.stat().st_size, compressed)
