"""Keep the finished frames of an unfinished film: a file for each kind of picture, with a JSON record beside them.

A record is written after its pictures have their final names, so that a job may be killed at any moment: a frame
without a record, or with a file that does not match its record, is drawn again. Every frame has its own record, so that
jobs that draw different frames of one film share nothing.
"""

from __future__ import annotations

import contextlib
import json
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from renderer.film import Picture, bytes_digest, frame_matches_digest, frame_path, write_staged
from renderer.job.executor import DrawnFrame
from renderer.record import FilmFingerprint, FrameRecord, read_frame_record, record_to_json
from renderer.scene import OutputSpec, PictureKind, read_json_object

# The name of a checkpoint file: the number of the frame, the number of the kind of picture, and the suffix. The first
# kind has no number, nor has the record.
_FILE_PATTERN = re.compile(r"([0-9]{6,9})\.(?:[0-9]{1,3}\.)?(json|png|exr)")
# The name of a file with the data of a fingerprint: all data that the frames of a film depend on.
_FINGERPRINT_PATTERN = re.compile(r"fingerprint-[0-9a-f]{32}\.json")
# The form of a fingerprint's digest: 32 hexadecimal digits.
_DIGEST_PATTERN = re.compile(r"[0-9a-f]{32}")
# The largest size, in bytes, of the JSON file of a record or a fingerprint. Some kilobytes are usual.
_MAX_JSON_BYTES = 2**26


class FrameStore:
    """A store of finished frames that does not keep newly drawn frames.

    It has the frames of the parts from which a film is assembled, or no frames.

    records: the records of the finished frames, by number.
    file: a function that returns the path of a picture, given the numbers of its frame and of its kind.
    is_output: whether the pictures are the files of the first output, which then need not be written.
    """

    is_output = False

    def __init__(
        self, output: OutputSpec, records: Mapping[int, FrameRecord], file: Callable[[int, int], Path]
    ) -> None:
        self._output, self._file = output, file
        self.records = dict(records)

    def finished_frame(self, number: int) -> DrawnFrame:
        """Return a finished frame. Its pictures are read on demand."""
        kinds = self._output.kinds_at(number)
        return DrawnFrame(self.records[number], {kind: Picture(file=self._file(number, kind)) for kind in kinds})

    def save(self, frame: DrawnFrame) -> FrameRecord:
        """Return the record of a drawn frame, with the digests of those of its pictures that become output files."""
        kinds = self._output.kinds
        in_files = {kinds.index(each.kind) for each in self._output.files if each.is_frames}
        return _with_digests(frame, kinds, in_files)


class FrameCheckpoint(FrameStore):
    """A store that keeps the finished frames of an output in files. Only one job at a time works on these frames.

    folder: the folder of the unfinished film; it exists.
    fingerprint: the fingerprint of the film. Frames with another fingerprint are removed.

    records: the records of finished frames, by number. The file of each frame has the digest in its record.
    former: the data of the fingerprint that removed frames had; empty if it is no longer known, None if no frame was
        removed.
    num_outdated: the number of removed frames.
    """

    def __init__(self, folder: Path, output: OutputSpec, numbers: Sequence[int], fingerprint: FilmFingerprint) -> None:
        super().__init__(output, {}, self._picture_path)
        self._folder, self._numbers = folder, frozenset(numbers)
        self._fingerprint = fingerprint
        self.former: Mapping[str, object] | None = None
        self.num_outdated = 0
        # Pictures that are output files themselves are written under their final names at once.
        self.is_output = output.is_frames
        for number in numbers:
            self._find(number)
        if self.former is not None and not self.records:
            remove_checkpoint_frames(folder, output, numbers)

    def _find(self, number: int) -> None:
        found = _read_frame(self._checkpoint_path(number, "json"))
        if found is None:
            return
        fingerprint_digest, record = found
        if fingerprint_digest == self._fingerprint.frames_digest:
            self.adopt_records([record])
            return
        if self.former is None:
            self.former = read_json_object(_fingerprint_path(self._folder, fingerprint_digest), _MAX_JSON_BYTES) or {}
        self.num_outdated += 1
        with contextlib.suppress(OSError):
            for path in self._folder.glob(f"{number:06}.*"):
                path.unlink(missing_ok=True)

    def adopt_records(self, records: Iterable[FrameRecord]) -> None:
        """Add records of a film with the same fingerprint, as far as the files of their frames exist and match them."""
        kinds = self._output.kinds
        for record in records:
            if record.frame in self._numbers and all(
                frame_matches_digest(self._picture_path(record.frame, kind), record.digest_of(kinds[kind]), kinds[kind])
                for kind in self._output.kinds_at(record.frame)
            ):
                self.records[record.frame] = record

    def save(self, frame: DrawnFrame) -> FrameRecord:
        """Write the pictures of a frame, and then its record. Return the record with the digests of the pictures."""
        number, record = frame.record.frame, _with_digests(frame, self._output.kinds, frame.pictures)
        for kind, picture in frame.pictures.items():
            self._write(self._picture_path(number, kind), picture.content)
        digest = self._fingerprint.frames_digest
        path = _fingerprint_path(self._folder, digest)
        if not path.exists():
            self._write(path, json.dumps(self._fingerprint.depends_on, allow_nan=False).encode())
        content = json.dumps({"fingerprint": digest, "record": record_to_json(record)}, allow_nan=False)
        self._write(self._checkpoint_path(number, "json"), content.encode())
        self.records[number] = record
        return record

    def _write(self, path: Path, content: bytes) -> None:
        # A job does not wait until a frame is on the disk. A frame that a power failure damages does not match its
        # record, and is drawn again.
        write_staged(path, content, self._folder, is_durable=False)

    def _picture_path(self, number: int, kind: int) -> Path:
        if self.is_output and kind == 0:
            return frame_path(self._output.file, number)
        suffix = "exr" if self._output.kinds[kind].depth == 32 else "png"
        return self._checkpoint_path(number, f"{kind}.{suffix}" if kind else suffix)

    def _checkpoint_path(self, number: int, suffix: str) -> Path:
        return self._folder / f"{number:06}.{suffix}"


def remove_checkpoint_frames(
    folder: Path, output: OutputSpec, numbers: Iterable[int], *, of: FilmFingerprint | None = None
) -> None:
    """Remove these frames from the folder of an unfinished film. The files of the output stay.

    If the film is one file, all its frames are removed. Of numbered frames, only these are removed, since another job
    may draw the other frames.
    of: only frames with this fingerprint are removed; None to remove frames with any fingerprint.
    """
    own = frozenset(numbers) if output.is_numbered else None

    def is_unwanted(number: str) -> bool:
        if own is not None and int(number) not in own:
            return False
        if of is None:
            return True
        found = _read_frame(folder / f"{number}.json")
        return found is None or found[0] == of.frames_digest

    with contextlib.suppress(OSError):  # the folder may have vanished
        files = [(path, name[1]) for path in folder.iterdir() if (name := _FILE_PATTERN.fullmatch(path.name))]
        unwanted = set(filter(is_unwanted, {number for _, number in files}))
        for path, number in files:
            if number in unwanted:
                path.unlink(missing_ok=True)
        if not any(path.exists() for path, _ in files):
            for path in folder.glob("fingerprint-*.json"):
                if _FINGERPRINT_PATTERN.fullmatch(path.name):
                    path.unlink(missing_ok=True)


def _with_digests(frame: DrawnFrame, kinds: Sequence[PictureKind], numbers: Collection[int]) -> FrameRecord:
    """Return the record of a frame with the digests of some of its pictures.

    numbers: the numbers of the kinds of pictures whose digests are recorded.
    """
    found = {kind: bytes_digest(picture.content) for kind, picture in frame.pictures.items() if kind in numbers}
    others = {kinds[kind].name: digest for kind, digest in found.items() if kind}
    return replace(frame.record, digest=found.get(0), digests=others or None)


def _fingerprint_path(folder: Path, fingerprint_digest: str) -> Path:
    """Return the path of the file for the data of a fingerprint. The data may be long, so all frames share one file."""
    return folder / f"fingerprint-{fingerprint_digest}.json"


def _read_frame(path: Path) -> tuple[str, FrameRecord] | None:
    """Return the digest of a fingerprint and the record of a frame from the frame's JSON file in a checkpoint.

    Return None if the file is missing or incomplete.
    """
    data = read_json_object(path, _MAX_JSON_BYTES) or {}
    digest, record = data.get("fingerprint"), read_frame_record(data.get("record"))
    if record is None or record.digest is None or not isinstance(digest, str):
        return None
    return (digest, record) if _DIGEST_PATTERN.fullmatch(digest) else None
