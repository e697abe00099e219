"""Finished frames of a film that is not whole: each a PNG file, and a journal that says what they are.

The journal is a line of JSON for what the frames depend on, then one for each frame that is in its file. A line is
added when the file has its name, so that a job may be killed at any moment: a frame without a line, or whose file is
not what the line says, is drawn again.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from renderer.picture import Picture
from renderer.staging import explained, write_staged

JOURNAL = "journal.jsonl"

Record = Mapping[str, Any]


class KeptFrames:
    """The frames of one film, of which only one job is at work on.

    folder: of what is not finished; it is there.
    file_of: the file of a frame, in the folder or under its final name.
    cause: what the frames depend on, as plain data; frames with another one are of no use.
    afresh: those that are there are of no use in any case.

    records: by number, of the frames whose files are what they should be; each has the `digest` of its file.
    former_cause, num_former: of the frames that were found and are of no use, where there are such.
    """

    def __init__(
        self, folder: Path, file_of: Callable[[int], Path], cause: Mapping[str, Any], *, afresh: bool = False
    ) -> None:
        self._journal, self._folder, self._file_of, self._is_begun = folder / JOURNAL, folder, file_of, False
        self.cause = _plain(cause)
        self.records: dict[int, Record] = {}
        former, records = _read_journal(self._journal)
        is_same = former == self.cause and not afresh
        self.former_cause = None if former == self.cause or not records else former
        self.num_former = 0 if is_same else len(records)
        if is_same:
            self.add_former(records)
        else:
            clear(folder)

    def add_former(self, records: Iterable[Record]) -> None:
        """Frames of the same cause that another journal tells of: those whose files are there and are the same."""
        for record in records:
            if is_file(self._file_of(record["frame"]), record["digest"]):
                self.records[record["frame"]] = record

    def keep(self, number: int, png: bytes, record: Record) -> Record:
        """Write a frame's file, then its line; the record with its digest."""
        record = {**record, "digest": digest(png)}
        write_staged(self._file_of(number), png, self._folder)
        with explained(self._file_of(number)):
            self._append([record])
        self.records[number] = record
        return record

    def picture(self, number: int) -> Picture:
        """A frame that is kept."""
        path = self._file_of(number)
        with explained(path):
            return Picture(png=path.read_bytes())

    def drop(self, numbers: Iterable[int]) -> None:
        """Draw these anew after all."""
        for number in numbers:
            del self.records[number]

    def _append(self, records: Iterable[Record]) -> None:
        """The first ones in a new journal, with all that is known before: the last line of the old one may be torn."""
        lines = [*records] if self._is_begun else [{"cause": self.cause}, *self.records.values(), *records]
        content = "".join(f"{json.dumps(line)}\n" for line in lines).encode()
        if not self._is_begun:
            write_staged(self._journal, content, self._folder)
            self._is_begun = True
            return
        descriptor = os.open(self._journal, os.O_WRONLY | os.O_APPEND | os.O_CLOEXEC)
        try:
            view = memoryview(content)
            while view:
                view = view[os.write(descriptor, view) :]
        finally:
            os.close(descriptor)


def clear(folder: Path, cause: Mapping[str, Any] | None = None) -> None:
    """Remove all frames that are kept in the folder itself, and in the end the journal; of this cause, if one is given.

    Those of another one may still be of use to a job like the one that they are of.
    """
    if cause is not None and _read_journal(folder / JOURNAL)[0] != _plain(cause):
        return
    for path in folder.glob("*.png"):
        if path.stem.isdecimal():
            path.unlink(missing_ok=True)
    (folder / JOURNAL).unlink(missing_ok=True)


def _plain(cause: Mapping[str, Any]) -> Any:
    """As it is read again: tuples are lists."""
    return json.loads(json.dumps(cause))


def digest(content: bytes) -> str:
    """32 hexadecimal digits that tell files apart."""
    return hashlib.blake2b(content, digest_size=16).hexdigest()


def is_file(path: Path, expected: str | None) -> bool:
    """Whether a file is there and has this digest."""
    try:
        return digest(path.read_bytes()) == expected
    except OSError:
        return False


def is_record(record: Any) -> bool:
    """Whether this, read from a file that anybody may have written, tells of a frame and what is in its file."""
    return isinstance(record, dict) and type(record.get("frame")) is int and isinstance(record.get("digest"), str)


def _read_journal(path: Path) -> tuple[Any, list[Record]]:
    """The cause, and the records up to the first line that is none: the last one may have been cut off."""
    try:
        lines = path.read_bytes().splitlines()
    except OSError:
        return None, []
    found = list(_records(lines))
    if not found or "cause" not in found[0]:
        return None, []
    return found[0]["cause"], [record for record in found[1:] if is_record(record)]


def _records(lines: Iterable[bytes]) -> Iterator[dict[str, Any]]:
    for line in lines:
        try:
            record = json.loads(line)
        except ValueError:
            return
        if not isinstance(record, dict):
            return
        yield record
