"""Read the metadata files of a store in a folder, a ZIP archive or at a URL, and say where its arrays are.

Metadata of a folder are read by this file itself: a link that leads out of the folder is not followed. A name that
metadata give is the name of a part of the same store: it is refused if it could lead elsewhere.
"""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from renderer.errors import InputError
from renderer.scene import is_url, short_text
from renderer.stores.library import (
    REQUEST_SECONDS,
    RefusedError,
    errors_of_library,
    import_library,
    make_context,
    s3_server,
)

# The largest size of a metadata file in bytes. The metadata of a store of 10,000 images, in one file, have some 10 MB.
_MAX_JSON_BYTES = 32 << 20
# The largest number of folders, or of files of an archive, among which arrays are searched for.
_MAX_SEARCHED = 10_000
# The ends of the names of ZIP archives that hold a store.
ZIP_SUFFIXES = (".zip", ".ozx")
# The files that describe a group or an array of Zarr: of version 3, or of version 2.
ZARR_FILES = ("zarr.json", ".zattrs", ".zgroup", ".zarray")
# The files that describe an array of Zarr; `zarr.json` may describe a group instead.
ARRAY_FILES = ("zarr.json", ".zarray")
# The file that describes a group or an array of N5.
N5_FILE = "attributes.json"
# The fields of which one is in the attributes of a store of N5.
_N5_FIELDS = ("n5", "dimensions", "multiScale", "downsamplingFactors", "multiscales")
# The file that describes a volume of Neuroglancer.
PRECOMPUTED_FILE = "info"


def is_store(folder: Path) -> bool:
    """Return whether a folder is a store, or a part of one, by the files in it."""
    if any((folder / name).is_file() for name in ZARR_FILES):
        return True
    attributes = _json_in_folder(folder, N5_FILE) or {}
    if any(name in attributes for name in _N5_FIELDS):
        return True
    return "scales" in (_json_in_folder(folder, PRECOMPUTED_FILE) or {})


def is_zipped_store(file: Path) -> bool:
    """Return whether a ZIP archive holds a store: by the end of its name, .ozx, or by the names of its members."""
    if file.suffix.lower() == ".ozx":
        return True
    try:
        with zipfile.ZipFile(file) as archive:
            names = archive.namelist()[:_MAX_SEARCHED]
    except (OSError, ValueError, zipfile.BadZipFile, NotImplementedError):
        return False
    return any(name.rpartition("/")[2] in (*ZARR_FILES, N5_FILE) or name == PRECOMPUTED_FILE for name in names)


class StoreFiles:
    """The files of a store. place: the path of a folder or of a ZIP archive, or a URL.

    refusal: the error of the last file that the server refused; such a file counts as missing.
    """

    def __init__(self, place: str) -> None:
        self.place = place
        self.refusal: RefusedError | None = None
        self._folder = None if is_url(place) or os.path.isfile(place) else Path(place)
        self._base = _kvstore(place)
        self._digest = hashlib.blake2b(digest_size=16)

    @property
    def marks(self) -> str:
        """Return a text that changes when the metadata at a URL do, or the versions that the server gives them."""
        return self._digest.hexdigest()

    def mark(self, content: bytes) -> None:
        """Add the metadata of a part of the store to its marks."""
        self._digest.update(b"%d " % len(content) + content)

    @cached_property
    def context(self) -> Any:
        """Return tensorstore's context for this store."""
        return make_context()

    def kvstore(self, path: str) -> dict[str, Any]:
        """Return tensorstore's specification of a folder in the store; an empty path is the store itself."""
        require_inside(path)
        return {**self._base, "path": f"{self._base['path']}{path}/" if path else self._base["path"]}

    def json(self, path: str, name: str) -> dict[str, Any] | None:
        """Return the JSON object in a file of a folder in the store; None if there is no such file.

        Raises InputError for a file that is too large, and for one that is no JSON object.
        """
        require_inside(path)
        if self._folder is not None:
            return _json_in_folder(self._folder, f"{path}/{name}" if path else name, is_strict=True)
        content = self._read(path, name)
        return None if content is None else _parsed(content, f"{self.place}/{path}/{name}".replace("//", "/"))

    def _read(self, path: str, name: str) -> bytes | None:
        """Return the content of a file of an archive or at a URL; None if it is missing or refused."""
        try:
            with errors_of_library("the metadata of this store cannot be read", self.place):
                store = import_library().KvStore.open(self.kvstore(path), context=self.context).result(REQUEST_SECONDS)
                found = store.read(name).result(REQUEST_SECONDS)
        except RefusedError as error:
            self.refusal = error
            return None
        if found.state == "missing":
            return None
        self.mark(bytes(found.stamp.generation) + bytes(found.value))
        return bytes(found.value)

    def folders_of_arrays(self) -> Iterator[str]:
        """Yield the paths of arrays of Zarr and of groups of Zarr 3: of a folder, the fewest levels below it first.

        Nothing is found at a URL, as servers do not list files.
        """
        if self._folder is not None:
            yield from _searched(self._folder)
        elif not is_url(self.place):
            with zipfile.ZipFile(self.place) as archive:
                names = archive.namelist()[: 10 * _MAX_SEARCHED]
            found = (name.rpartition("/") for name in names)
            yield from sorted({path for path, _, name in found if name in ARRAY_FILES}, key=lambda p: (p.count("/"), p))


def require_inside(path: str) -> None:
    """Raise InputError for a path, which metadata may give, that could lead out of the store."""
    parts = path.split("/")
    if "://" in path or "|" in path or "\0" in path or "\\" in path or path.startswith("/") or ".." in parts:
        raise InputError(
            "the metadata of this store name a place outside of it, which is not followed",
            got=short_text(path),
            expected="the path of an array in the store",
        )


def _kvstore(place: str) -> dict[str, Any]:
    """Return tensorstore's specification of the root of a store."""
    if not is_url(place):
        real = os.path.abspath(place)
        if os.path.isfile(real):
            return {"driver": "zip", "base": {"driver": "file", "path": real}, "path": ""}
        return {"driver": "file", "path": f"{real}/"}
    parts = urlsplit(place)
    path = parts.path.strip("/")
    if parts.scheme in ("http", "https"):
        query = f"?{parts.query}" if parts.query else ""
        base = {"driver": "http", "base_url": f"{parts.scheme}://{parts.netloc}{query}", "path": f"/{path}"}
    elif parts.scheme == "gs":
        base = {"driver": "gcs", "bucket": parts.netloc, "path": path}
    else:
        base = {"driver": "s3", "bucket": parts.netloc, "path": path, **s3_server()}
    if path.lower().endswith(ZIP_SUFFIXES):
        return {"driver": "zip", "base": base, "path": ""}
    return {**base, "path": f"{base['path'].rstrip('/')}/" if path or parts.scheme in ("http", "https") else ""}


def _json_in_folder(folder: Path, name: str, *, is_strict: bool = False) -> dict[str, Any] | None:
    """Return the JSON object in a regular file of a folder; None if there is no such file.

    is_strict: whether a file that is too large, or no JSON object, raises InputError; otherwise it counts as missing.
    """
    file = folder / name
    root = os.path.realpath(folder)
    if not file.is_file() or not Path(os.path.realpath(file)).is_relative_to(root):
        return None
    size = file.stat().st_size
    if size > _MAX_JSON_BYTES:
        if not is_strict:
            return None
        raise _too_large(str(file), size)
    try:
        return _parsed(file.read_bytes(), str(file))
    except InputError:
        if is_strict:
            raise
        return None


def _parsed(content: bytes, where: str) -> dict[str, Any]:
    if len(content) > _MAX_JSON_BYTES:
        raise _too_large(where, len(content))
    try:
        found = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise InputError(
            "the metadata of this store are not JSON",
            where=where,
            got=short_text(" ".join(str(error).split())),
            hint="the store is damaged, or the server sent another page",
        ) from error
    if not isinstance(found, dict):
        raise InputError("the metadata of this store are not a JSON object", where=where, got=type(found).__name__)
    return found


def _too_large(where: str, size: int) -> InputError:
    expected = f"at most {_MAX_JSON_BYTES} bytes"
    return InputError("too large for the metadata of a store", where=where, got=f"{size} bytes", expected=expected)


def _searched(folder: Path) -> Iterator[str]:
    """Yield the paths of arrays and groups below a folder, which a search finds level by level; no link is followed."""
    num_left, paths = _MAX_SEARCHED, [""]
    while paths and num_left > 0:
        num_left -= len(paths)
        below: list[str] = []
        for path in paths:
            here = folder / path
            if any((here / name).is_file() for name in ARRAY_FILES):
                yield path
            if (here / ".zarray").is_file() or (_json_in_folder(here, "zarr.json") or {}).get("node_type") == "array":
                continue  # folders below an array are of its chunks
            with os.scandir(here) as entries:
                names = sorted(entry.name for entry in entries if entry.is_dir(follow_symlinks=False))
            below += [f"{path}/{name}" if path else name for name in names]
        paths = below[:num_left] if num_left > 0 else []
