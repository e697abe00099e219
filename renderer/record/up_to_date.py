"""Tell whether something that was made is up to date: a film, golden frames, or one of the films in a folder.

It is up to date if the same program would make it from the same inputs, and if its files are as they were written.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from renderer.film import data_digest, file_matches_digest, frame_matches_digest
from renderer.scene import PictureKind, first_few, format_value, join_keys
from renderer.system import package_versions, sources_digest

# A list of files. Each has its name, and its size and times of change; no numbers if the file is missing.
FileStates = list[tuple[str, tuple[int, ...]]]


@dataclass(frozen=True)
class Fingerprint:
    """A fingerprint of something that is made: all that it depends on, as plain data, and the digest of this data.

    A record may have the digest alone; `depends_on` is empty then.
    """

    digest: str
    depends_on: Mapping[str, Any]

    @classmethod
    def of(cls, **depends_on: Any) -> Fingerprint:
        """Return the fingerprint of something that depends on this data, which may have any form that JSON has."""
        data = json.loads(json.dumps(depends_on))
        return cls(data_digest(data), data)

    def change(self, now: Fingerprint) -> str:
        """Return in words how this recorded fingerprint differs from the fingerprint `now`; empty if they are equal."""
        return "" if self.digest == now.digest else describe_mismatch(self.depends_on, now.depends_on)


@dataclass(frozen=True)
class MadeFile:
    """A file that was made.

    digest: the recorded digest of the file as it was written; None if it is not known.
    kind: the kind of the picture in the file; None for a file that is not one picture.
    """

    path: Path
    digest: str | None
    kind: PictureKind | None = None

    @property
    def is_unchanged(self) -> bool:
        """Return whether the file exists as it was written. A file without a recorded digest counts as changed."""
        if self.kind is None:
            return file_matches_digest(self.path, self.digest)
        return frame_matches_digest(self.path, self.digest, self.kind)


def program_versions() -> dict[str, Any]:
    """Return the part of a fingerprint about this program: the versions of packages, and a digest of the sources."""
    return {"versions": package_versions(), "sources": sources_digest()}


def file_states(files: Iterable[Path]) -> FileStates:
    """Return the states of files: sizes and times of change, which are known without reading the files.

    A file's state changes whenever its content does, as no program can set the time of the last change of a file.
    """
    return [(str(file), _state(file)) for file in files]


def _state(file: Path) -> tuple[int, ...]:
    try:
        found = file.stat()
    except (OSError, ValueError):
        return ()
    return found.st_size, found.st_mtime_ns, found.st_ctime_ns


# Differences between fingerprints, in words


def describe_mismatch(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Return why the recorded data of a fingerprint has another digest than the data `now`.

    before: the recorded data, which anybody may have edited; empty if only the digest is recorded.
    """
    if not before:
        return "its scene is not recorded"
    return describe_differences(before, now) or "the record of its scene was changed"


def describe_differences(before: Any, now: Any) -> str:
    """Return the first few keys in which two fingerprints' data differ: `scene.error.tolerance was 0.2`."""
    found = [f"{path} was {format_value(old)}" for path, old, _ in differences(before, now)]
    return first_few(found, between="; ")


def differences(before: Any, now: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted path of each value that differs in two trees of plain data, and both values.

    A missing value counts as None. path: the dotted path of both trees.
    """
    if isinstance(before, list) and isinstance(now, list) and any(isinstance(item, dict) for item in now):
        before, now = dict(enumerate(before)), dict(enumerate(now))
    if isinstance(before, dict) and isinstance(now, dict):
        for key in dict.fromkeys([*now, *before]):
            yield from differences(before.get(key), now.get(key), join_keys(path, key))
    elif before != now:
        yield path, before, now
