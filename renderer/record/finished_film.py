"""Look at the film that is there: up to date, or the film of another job, or less than what is requested."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from renderer.errors import SceneError
from renderer.film import file_matches_digest, frame_matches_digest, frame_path
from renderer.job.events import JobEvents
from renderer.record.film_record import FilmFingerprint, FilmRecord, record_from_json
from renderer.record.fingerprint import describe_differences, describe_mismatch
from renderer.scene import FRAME_FIELD, MAX_SIDECAR_BYTES, OutputFile, OutputSpec, read_json_object


@dataclass(frozen=True)
class ExistingFilm:
    """A film as its sidecar describes it; anybody may have edited the sidecar."""

    record: FilmRecord
    fingerprint: FilmFingerprint

    @property
    def is_complete(self) -> bool:
        """Return whether it meets what was requested."""
        return self.record.schedule.met and "total" in self.record.seconds

    def is_up_to_date(self, fingerprint: FilmFingerprint, output: OutputSpec, frames: Sequence[int]) -> bool:
        """Return whether it is the film that is requested, and its files are those that were written."""
        return not self._change(fingerprint, frames) and self.is_complete and self._changed_file(output) is None

    def why_stale(self, fingerprint: FilmFingerprint, output: OutputSpec, frames: Sequence[int]) -> str:
        """Return why this film is not up to date, as the end of a sentence about it.

        It is empty for numbered frames of the same fingerprint, which are kept or redrawn one by one.
        """
        change = self._change(fingerprint, frames)
        if output.is_frames:
            is_kept = self.fingerprint.frames_digest == fingerprint.frames_digest
            return "" if is_kept else f"is another film and is drawn again: {change}"
        if not output.file.exists():
            return f"does not exist, and its sidecar describes another film: {change}" if change else ""
        if change:
            return f"is another film and is drawn again: {change}"
        if not self.is_complete:
            return "is less than what was requested and is drawn again"
        file = self._changed_file(output)
        why = "is not the file that its sidecar describes"
        if file is not None and file != output.file:
            is_gone = not (FRAME_FIELD.search(str(file)) or file.exists())
            why = f"has no {file} beside it" if is_gone else f"has another {file} beside it than its sidecar describes"
        return f"{why} and is drawn again"

    def _change(self, fingerprint: FilmFingerprint, frames: Sequence[int]) -> str:
        """Return what distinguishes the requested film from this one; empty if nothing does."""
        own = self.fingerprint
        if own.frames_digest != fingerprint.frames_digest:
            return describe_mismatch(own.depends_on, fingerprint.depends_on)
        if own.encoding != fingerprint.encoding or [*self.record.numbers] != [*frames]:
            return describe_differences(own.encoding, fingerprint.encoding) or "it has other frames"
        return ""

    def _changed_file(self, output: OutputSpec) -> Path | None:
        """Return the first output that is not the file that was written; None if all are."""
        digests = [self.record.digest, *(each.digest for each in self.record.outputs)]
        if len(digests) != len(output.files):
            return output.file
        for each, digest in zip(output.files, digests, strict=True):
            if not (self._has_frames(each) if each.is_frames else file_matches_digest(each.file, digest)):
                return each.file
        return None

    def _has_frames(self, output: OutputFile) -> bool:
        """Return whether the files of an output's frames are those that were written."""
        return all(
            frame_matches_digest(frame_path(output.file, each.frame), each.digest_of(output.kind), output.kind)
            for each in self.record.frames
            if output.shows(each.frame)
        )


def find_existing_film(sidecar: Path, events: JobEvents) -> ExistingFilm | None:
    """Return the film that the sidecar of an output describes; None where there is none, or one that is not usable."""
    data = read_json_object(sidecar, MAX_SIDECAR_BYTES)
    try:
        record = None if data is None else record_from_json(data, sidecar)
    except SceneError as error:
        what = error.problems[0]
        events.note(f"{sidecar} is not a record that can be used: {what.path}: {what.what}")
        return None
    return None if record is None or record.fingerprint is None else ExistingFilm(record, record.fingerprint)
