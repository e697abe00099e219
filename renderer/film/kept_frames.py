"""Finished frames of a film that is not whole: each a PNG file, and beside it a record that says what it is.

A record is written when the picture has its name, so that a job may be killed at any moment: a frame without a record,
or whose file is not what the record says, is drawn again. Each frame has a record of its own: jobs that draw different
frames of one film share nothing.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from renderer.errors import RenderError
from renderer.film.atomic import translate_os_errors, write_staged
from renderer.film.frame_record import Record, is_frame_record
from renderer.film.names import frame_path, has_frame_files, is_numbered, picture_shape
from renderer.film.picture import Picture
from renderer.film.png import png_shape
from renderer.scene import OutputSpec

_FILE = re.compile(r"([0-9]{6,9})\.(json|png)")
_MARK = re.compile(r"[0-9a-f]{32}")
_MOST_BYTES = 2**26  # of a record or a cause; some kilobytes are usual
_BLOCK = 2**20


class FrameCheckpoint:
    """Those of some frames of an output that are there; only one job is at work on them.

    folder: of what is not finished; it is there.
    cause: what the frames depend on, as plain data; frames with another one are of no use, and are removed.
    afresh: those that are there are of no use in any case.

    records: by number, of the frames whose files are what they should be; each has the `digest` of its file.
    former_fingerprint, num_outdated: of the frames that were there, with another cause; empty where it is not known any
    more. num_dropped: frames of this cause that are drawn anew after all.
    """

    def __init__(
        self,
        folder: Path,
        output: OutputSpec,
        numbers: Sequence[int],
        cause: Mapping[str, Any],
        *,
        afresh: bool = False,
    ) -> None:
        self._folder, self._output, self._numbers = folder, output, frozenset(numbers)
        self.cause: Record = json.loads(json.dumps(cause))  # as it is read again: tuples are lists
        self._mark, self._is_told = data_digest(cause), False
        self.records: dict[int, Record] = {}
        self.former_fingerprint: Record | None = None
        self.num_outdated = self.num_dropped = 0
        if afresh:
            remove_checkpoint_frames(folder, output, numbers)
        for number in numbers:
            self._find(number)
        if self.former_fingerprint is not None and not self.records:
            remove_checkpoint_frames(folder, output, numbers)

    def _find(self, number: int) -> None:
        found = _read(self._own(number, "json"))
        if found is None:
            return
        mark, record = found
        if mark == self._mark:
            self.adopt_records([record])
        else:
            if self.former_fingerprint is None:
                self.former_fingerprint = _read_json_object(_fingerprint_path(self._folder, mark)) or {}
            self.num_outdated += 1
            with contextlib.suppress(OSError):
                for path in (self._own(number, "json"), self._own(number, "png")):
                    path.unlink(missing_ok=True)

    def adopt_records(self, records: Iterable[Record]) -> None:
        """Frames of the same cause that are told of elsewhere: those whose files are there and are the same."""
        for record in records:
            number = record["frame"]
            if number in self._numbers and frame_matches_digest(self._file(number), record["digest"], self._output):
                self.records[number] = record

    def keep(self, number: int, png: bytes, record: Record) -> Record:
        """Write a frame's picture, then its record; the record with its digest."""
        record = {**record, "digest": bytes_digest(png)}
        write_staged(self._file(number), png, self._folder)
        if not self._is_told:
            write_staged(_fingerprint_path(self._folder, self._mark), json.dumps(self.cause).encode(), self._folder)
            self._is_told = True
        content = json.dumps({"cause": self._mark, "record": record}).encode()
        write_staged(self._own(number, "json"), content, self._folder)
        self.records[number] = record
        return record

    def picture(self, number: int) -> Picture:
        """A frame that is kept, decoded. Raises RenderError where it cannot be; then it is kept no longer."""
        path = self._file(number)
        try:
            with translate_os_errors(path):
                picture = Picture(png=path.read_bytes())
            return Picture(picture.pixels, picture.png)
        except ValueError as error:
            del self.records[number]
            with translate_os_errors(path):
                self._own(number, "json").unlink(missing_ok=True)
            hint = "the same command draws it again"
            raise RenderError("a frame that was kept cannot be decoded", where=str(path), hint=hint) from error

    def drop(self, is_wanted: Callable[[Record], bool]) -> None:
        """Draw the others anew after all."""
        wanted = {number: record for number, record in self.records.items() if is_wanted(record)}
        self.num_dropped += len(self.records) - len(wanted)
        self.records = wanted

    def _file(self, number: int) -> Path:
        return frame_path(self._output.file, number) if has_frame_files(self._output) else self._own(number, "png")

    def _own(self, number: int, suffix: str) -> Path:
        return self._folder / f"{number:06}.{suffix}"


def remove_checkpoint_frames(
    folder: Path, output: OutputSpec, numbers: Iterable[int], cause: Mapping[str, Any] | None = None
) -> None:
    """Remove what a folder has of these frames, which is not what the output has; of an output in one file, of all.

    Others of an output with numbered files may be those of another job.
    cause: those with another one stay; None removes them, too.
    """
    own = frozenset(numbers) if is_numbered(output) else None
    with contextlib.suppress(OSError):  # it has vanished: nothing is left
        files = [(path, name[1]) for path in folder.iterdir() if (name := _FILE.fullmatch(path.name))]
        gone = {number for _, number in files if own is None or int(number) in own}
        if cause is not None:
            mark = data_digest(cause)
            told = {number: _read(folder / f"{number}.json") for number in gone}
            gone -= {number for number, found in told.items() if found is not None and found[0] != mark}
        for path, number in files:
            if number in gone:
                path.unlink(missing_ok=True)
        others = any(path.exists() for path, _ in files)
        for path in [] if others else list(folder.glob("cause-*.json")):
            path.unlink(missing_ok=True)


def bytes_digest(content: bytes) -> str:
    """32 hexadecimal digits that tell files apart."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def data_digest(data: Any) -> str:
    """The same of plain data, such as a cause; equal data have an equal mark, whatever the order of their keys."""
    return bytes_digest(json.dumps(data, sort_keys=True).encode())


def file_digest(path: Path) -> str:
    """The digest of a file, of any size. Raises OSError."""
    found = hashlib.blake2b(digest_size=16)
    with path.open("rb") as stream:
        while block := stream.read(_BLOCK):
            found.update(block)
    return found.hexdigest()


def file_matches_digest(path: Path, expected: str | None) -> bool:
    """Whether a file is there and has this digest."""
    try:
        return path.is_file() and file_digest(path) == expected
    except OSError:
        return False


def frame_matches_digest(path: Path, expected: str, output: OutputSpec) -> bool:
    """Whether a PNG file is there and has this digest, and the size and channels of an output's pictures."""
    try:
        content = path.read_bytes() if path.is_file() else b""
        return bytes_digest(content) == expected and png_shape(content) == picture_shape(output)
    except (OSError, ValueError):
        return False


def _fingerprint_path(folder: Path, mark: str) -> Path:
    """What frames depend on, once for all of them: of a film with a schedule by frame it is long."""
    return folder / f"cause-{mark}.json"


def _read(path: Path) -> tuple[str, Record] | None:
    """The mark of the cause and the record of a frame, if there is a whole one."""
    data = _read_json_object(path)
    if data is None or not is_frame_record(data.get("record")):
        return None
    mark = data.get("cause")
    return (mark, data["record"]) if isinstance(mark, str) and _MARK.fullmatch(mark) else None


def _read_json_object(path: Path) -> Record | None:
    """An object of JSON, if there is a whole one of a size that can be."""
    try:
        if not path.is_file() or path.stat().st_size > _MOST_BYTES:
            return None
        data = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
    return data if isinstance(data, dict) else None
