"""Keep the finished frames of an unfinished film: each a PNG file, with a JSON record beside it.

A record is written after its picture has its final name, so that a job may be killed at any moment: a frame without a
record, or whose file does not match its record, is drawn again. Every frame has its own record, so that jobs which draw
different frames of one film share nothing.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from renderer.film.atomic import write_staged
from renderer.film.names import frame_path, has_frame_files, is_numbered, picture_shape
from renderer.film.picture import Picture
from renderer.film.png import png_shape
from renderer.scene import OutputSpec, read_json_object

Record = Mapping[str, Any]

_RECORD_KEYS = {"frame", "digest", "tolerance", "cells", "splats", "seconds", "predicted_seconds", "gl", "blank"}
_FILE_PATTERN = re.compile(r"([0-9]{6,9})\.(json|png)")
_FINGERPRINT_PATTERN = re.compile(r"cause-[0-9a-f]{32}\.json")
_DIGEST_PATTERN = re.compile(r"[0-9a-f]{32}")
_MAX_JSON_BYTES = 2**26  # of a record or a fingerprint; some kilobytes are usual
_BLOCK_BYTES = 2**20


class FrameCheckpoint:
    """The finished frames of an output, for the only job that works on them.

    folder: the folder of the unfinished film; it exists.
    fingerprint: what the frames depend on, as plain data. Frames with another fingerprint are removed.
    discard_existing: remove existing frames in any case.

    records: by frame number, of the frames whose files match them; each has the `digest` of its file.
    former_fingerprint, num_outdated: of frames with another fingerprint, which is empty if it is no longer known.
    """

    def __init__(
        self,
        folder: Path,
        output: OutputSpec,
        numbers: Sequence[int],
        fingerprint: Mapping[str, Any],
        *,
        discard_existing: bool = False,
    ) -> None:
        self._folder, self._output, self._numbers = folder, output, frozenset(numbers)
        self.fingerprint: Record = json.loads(json.dumps(fingerprint))  # as it is read again: tuples are lists
        self._digest = data_digest(fingerprint)
        self.records: dict[int, Record] = {}
        self.former_fingerprint: Record | None = None
        self.num_outdated = 0
        if discard_existing:
            remove_checkpoint_frames(folder, output, numbers)
        for number in numbers:
            self._find(number)
        if self.former_fingerprint is not None and not self.records:
            remove_checkpoint_frames(folder, output, numbers)

    def _find(self, number: int) -> None:
        found = _read_frame_record(self._checkpoint_path(number, "json"))
        if found is None:
            return
        fingerprint_digest, record = found
        if fingerprint_digest == self._digest:
            self.adopt_records([record])
            return
        if self.former_fingerprint is None:
            self.former_fingerprint = (
                read_json_object(_fingerprint_path(self._folder, fingerprint_digest), _MAX_JSON_BYTES) or {}
            )
        self.num_outdated += 1
        with contextlib.suppress(OSError):
            for suffix in ("json", "png"):
                self._checkpoint_path(number, suffix).unlink(missing_ok=True)

    def adopt_records(self, records: Iterable[Record]) -> None:
        """Add records from elsewhere, with the same fingerprint, of frames whose files exist and match."""
        for record in records:
            number = record["frame"]
            if number in self._numbers and frame_matches_digest(self._file(number), record["digest"], self._output):
                self.records[number] = record

    def save_frame(self, number: int, png: bytes, record: Record) -> Record:
        """Write a frame's picture, then its record. Return the record with its digest."""
        record = {**record, "digest": bytes_digest(png)}
        self._write(self._file(number), png)
        path = _fingerprint_path(self._folder, self._digest)
        if not path.exists():
            self._write(path, json.dumps(self.fingerprint).encode())
        content = json.dumps({"cause": self._digest, "record": record}).encode()
        self._write(self._checkpoint_path(number, "json"), content)
        self.records[number] = record
        return record

    def _write(self, path: Path, content: bytes) -> None:
        # No frame waits for the disk: one that a power failure damages does not match its record, and is drawn again.
        write_staged(path, content, self._folder, is_durable=False)

    def picture(self, number: int) -> Picture:
        """Return a finished frame, which is read on demand."""
        return Picture(file=self._file(number))

    def _file(self, number: int) -> Path:
        if has_frame_files(self._output):
            return frame_path(self._output.file, number)
        return self._checkpoint_path(number, "png")

    def _checkpoint_path(self, number: int, suffix: str) -> Path:
        return self._folder / f"{number:06}.{suffix}"


def remove_checkpoint_frames(
    folder: Path, output: OutputSpec, numbers: Iterable[int], fingerprint: Mapping[str, Any] | None = None
) -> None:
    """Remove these frames from a folder; for an output in one file, all frames. The output's own files stay.

    Other frames of an output with numbered files may be those of another job.
    fingerprint: frames with another one stay; None removes all.
    """
    own = frozenset(numbers) if is_numbered(output) else None
    with contextlib.suppress(OSError):  # the folder has vanished: nothing is left
        files = [(path, name[1]) for path in folder.iterdir() if (name := _FILE_PATTERN.fullmatch(path.name))]
        unwanted = {number for _, number in files if own is None or int(number) in own}
        if fingerprint is not None:
            digest = data_digest(fingerprint)
            found = {number: _read_frame_record(folder / f"{number}.json") for number in unwanted}
            unwanted -= {number for number, record in found.items() if record is not None and record[0] != digest}
        for path, number in files:
            if number in unwanted:
                path.unlink(missing_ok=True)
        if not any(path.exists() for path, _ in files):
            for path in folder.glob("cause-*.json"):
                if _FINGERPRINT_PATTERN.fullmatch(path.name):
                    path.unlink(missing_ok=True)


def is_frame_record(record: Any, *, has_digest: bool = True) -> bool:
    """Return whether a value from an untrusted file is a complete record of a frame.

    A record has the frame's number as `frame`, the `digest` of its PNG file, `tolerance`, `cells`, `splats`, `seconds`
    by stage; `predicted_seconds` if it was drawn with a budget of time, `gl` if it was drawn elsewhere, and `blank`,
    true, if nothing of the volume shows.

    has_digest: whether the digest is required.
    """
    if not isinstance(record, dict):
        return False
    seconds, predicted = record.get("seconds"), record.get("predicted_seconds", 0.0)
    return (
        set(record) <= _RECORD_KEYS
        and isinstance(record.get("gl", ""), str)
        and record.get("blank", True) is True
        and isinstance(record.get("digest", None if has_digest else ""), str)
        and all(type(record.get(key)) is int and 0 <= record[key] < 2**63 for key in ("frame", "cells", "splats"))
        and isinstance(seconds, dict)
        and all(map(_is_nonnegative_number, [record.get("tolerance"), predicted, *seconds.values()]))
    )


def _is_nonnegative_number(value: Any) -> bool:
    return type(value) in (int, float) and 0 <= value <= sys.float_info.max  # integers in JSON may be larger


def bytes_digest(content: bytes) -> str:
    """Return a digest of 32 hexadecimal digits that tells contents apart."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def data_digest(data: Any) -> str:
    """Return the digest of plain data, such as a fingerprint, whatever the order of its keys."""
    return bytes_digest(json.dumps(data, sort_keys=True).encode())


def file_digest(path: Path) -> str:
    """Return the digest of a file of any size. Raises OSError."""
    found = hashlib.blake2b(digest_size=16)
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK_BYTES):
            found.update(block)
    return found.hexdigest()


def file_matches_digest(path: Path, expected: str | None) -> bool:
    """Return whether a file exists and has this digest."""
    try:
        return path.is_file() and file_digest(path) == expected
    except OSError:
        return False


def frame_matches_digest(path: Path, expected: str, output: OutputSpec) -> bool:
    """Return whether a PNG file exists and has this digest, and the size and channels of the output's pictures."""
    try:
        content = path.read_bytes() if path.is_file() else b""
        return bytes_digest(content) == expected and png_shape(content) == picture_shape(output)
    except (OSError, ValueError):
        return False


def _fingerprint_path(folder: Path, fingerprint_digest: str) -> Path:
    """Return the path of the fingerprint, written once for all frames because it may be long."""
    return folder / f"cause-{fingerprint_digest}.json"


def _read_frame_record(path: Path) -> tuple[str, Record] | None:
    """Return the digest of the fingerprint and the record of a frame, if the file is complete."""
    data = read_json_object(path, _MAX_JSON_BYTES)
    if data is None or not is_frame_record(data.get("record")):
        return None
    digest = data.get("cause")
    return (digest, data["record"]) if isinstance(digest, str) and _DIGEST_PATTERN.fullmatch(digest) else None
