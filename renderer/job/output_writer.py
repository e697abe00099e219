"""Write a film to the output that its job has locked: its frames, the encoded files, and the sidecar."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Collection, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from renderer.accuracy import MOST_DB, EncodingErrors, encoding_loss, psnr
from renderer.errors import RenderError
from renderer.film import (
    Picture,
    Pixels,
    WriteFrame,
    file_digest,
    locked_output,
    open_films,
    require_encoder,
    translate_os_errors,
    write_staged,
)
from renderer.job.checkpoint import FrameStore
from renderer.job.events import JobEvents
from renderer.job.executor import DrawnFrame
from renderer.job.trial_encoding import try_finer_encoding
from renderer.record import (
    SIDECAR,
    FilmFingerprint,
    FilmRecord,
    FrameRecord,
    OutputRecord,
    naming_mark,
    require_own_files,
    with_encoding_errors,
)
from renderer.scene import OutputFile, OutputSpec, relative_path, with_files
from renderer.system import overlap

# At most this many frames are decoded from a finished film and compared with the drawn frames, as decoding a whole film
# would take a tenth of the time of encoding it.
_MAX_COMPARED = 8
# At most this many bytes of drawn pictures are kept for each file, to compare them with the decoded frames of a film.
_MAX_COMPARED_BYTES = 2**26

# A function that measures the errors which encoding adds to the first frames of the first output, from the drawn
# pictures of these frames.
MeasureEncoding = Callable[[Sequence[Pixels]], EncodingErrors]


@dataclass(frozen=True)
class OutputWriter:
    """A writer of a film to an output that its job has locked.

    spec: the output files. frames: the numbers of the frames, ascending.
    sidecar: the path of the sidecar. folder: the folder for unfinished work.
    first_pictures: the first pictures of each file, from the last call of `write_frames`, to compare with the decoded
        file.
    """

    spec: OutputSpec
    frames: Sequence[int]
    sidecar: Path
    folder: Path
    first_pictures: dict[Path, list[Picture]] = field(default_factory=dict)

    def write_frames(
        self,
        store: FrameStore,
        drawn: Generator[DrawnFrame, None, None],
        label: str,
        events: JobEvents,
        defer_interrupts: Callable[[], None],
        *,
        is_overlapped: bool,
    ) -> list[FrameRecord]:
        """Write the frames of a store and newly drawn frames to all files, and return the records of all frames.

        store: finished frames, such as a checkpoint; newly drawn frames are saved in it.
        drawn: a generator of the frames that the store lacks, ascending.
        label: the name of the film, or of its pass, for the listener.
        defer_interrupts: called before files get their final names.
        is_overlapped: whether a frame is stored while the next one is drawn. If not, the time of storing it is part of
            the frame's time.
        """
        missing = frozenset(self.frames).difference(store.records)
        # If no frame is missing, the listener is told the frames that are written.
        shown = missing or frozenset(self.frames)
        events.started(label, len(shown))
        # The pictures of the store may already be the files of the first output.
        files = self.shown[1:] if store.is_output else self.shown

        def before_rename() -> None:
            defer_interrupts()
            if self.shown[1:]:
                write_staged(naming_mark(self.spec, self.sidecar), b"", self.folder)

        films = open_films(files, self.spec.kinds, is_locked=True, before_rename=before_rename)

        failures = list[Exception]()

        def frames() -> Iterator[DrawnFrame]:
            for number in self.frames:
                if failures:
                    yield from _frames_in_progress(drawn, failures[0])
                    return
                yield _next_frame(drawn, number) if number in missing else store.finished_frame(number)

        records = list[FrameRecord]()
        with films as write_to_films:
            self.first_pictures.clear()
            write = partial(self._write_and_remember, write_to_films)
            keep = partial(_store_frame, store=store, write=write, missing=missing)
            stored = overlap(frames(), keep) if is_overlapped else (keep(frame) for frame in frames())
            # Each drawn frame is stored before this block is left, also if an error ends it.
            with contextlib.closing(stored):
                for record in stored:
                    records.append(record)
                    if record.frame in shown and not failures:
                        try:
                            events.frame_finished(record)
                        except Exception as error:  # a listener may end the job; frames in progress are still stored
                            failures.append(error)
            if failures:
                raise failures[0]
        return records

    @property
    def shown(self) -> list[OutputFile]:
        """Return the files of the output that have at least one of the frames."""
        return self.spec.shown(self.frames)

    def _write_and_remember(self, write: WriteFrame, number: int, pictures: Mapping[int, Picture]) -> None:
        write(number, pictures)
        kinds = self.spec.kinds
        for each in (each for each in self.spec.files if each.shows(number)):
            first = self.first_pictures.setdefault(each.file, [])
            num_bytes = math.prod(each.kind.shape) * each.kind.depth // 8
            if len(first) < min(_MAX_COMPARED, max(1, _MAX_COMPARED_BYTES // num_bytes)):
                first.append(pictures[kinds.index(each.kind)])

    def write_record(
        self, record: FilmRecord, fingerprint: FilmFingerprint | None, measure: MeasureEncoding | None = None
    ) -> FilmRecord:
        """Write the sidecar of a film. Return its record, in which paths are relative to the sidecar.

        fingerprint: the fingerprint of the film, by which the next job sees that the film is up to date; None for a
        film that the next job makes again. With a fingerprint, the record gets the digest of each encoded film file.
        The records of numbered image files have digests in any case.
        measure: the function that measures the encoding of the first output; None without exact rays.
        """
        films, accuracy = [each for each in self.shown if not each.is_frames], record.accuracy
        digests = {} if fingerprint is None else {each.file: _digest(each.file) for each in films}
        losses = (
            {} if accuracy is None else {each.file: self._loss(each) for each in films if each.file != self.spec.file}
        )
        if accuracy is not None and not self.spec.is_frames:
            pictures = self.first_pictures[self.spec.file]
            first = [picture.pixels for picture in pictures]
            errors = EncodingErrors(self._loss(self.spec)) if measure is None else measure(first)
            finer = try_finer_encoding(self.spec, pictures, len(self.frames), errors, accuracy)
            accuracy = with_encoding_errors(accuracy, errors, len(pictures), finer)
        outputs = tuple(
            OutputRecord(
                str(each.file),
                sum(map(each.shows, self.frames)),
                digests.get(each.file),
                min(psnr(losses[each.file]), MOST_DB) if each.file in losses else None,
            )
            for each in self.spec.others
        )
        digest = digests.get(self.spec.file)
        record = replace(record, fingerprint=fingerprint, accuracy=accuracy, digest=digest, outputs=outputs)
        record = _relative_to(self.sidecar.parent, record)
        SIDECAR.write(self.sidecar, record, self.folder)
        self.remove_mark()
        return record

    def remove_mark(self) -> None:
        """Remove the mark file, which says that the film is newer than its sidecar, as the sidecar now describes it."""
        with translate_os_errors(self.sidecar):
            naming_mark(self.spec, self.sidecar).unlink(missing_ok=True)

    def _loss(self, output: OutputFile) -> float:
        first = [picture.pixels for picture in self.first_pictures[output.file]]
        return encoding_loss(output, sum(map(output.shows, self.frames)), first)


@contextlib.contextmanager
def open_output(spec: OutputSpec, frames: Sequence[int], sidecar: Path, *, resumes: bool) -> Iterator[OutputWriter]:
    """Lock an output, and yield its writer.

    resumes: whether files that were not made as this film are kept; InputError is raised if such a file is in the way.
    Raises OutputLockedError if another job is writing the output, and InputError or RenderError if a file cannot be
    written or an encoder is missing.
    """
    with locked_output(spec, frames, sidecar) as folder:
        if resumes:
            require_own_files(spec, frames, sidecar)
        require_encoder(spec)
        yield OutputWriter(spec, frames, sidecar, folder)


def _relative_to(folder: Path, record: FilmRecord) -> FilmRecord:
    """Return a record in which the paths of files are relative to a folder."""
    return replace(
        record,
        scene=with_files(record.scene, lambda _, file: relative_path(file, folder)),
        outputs=tuple(replace(each, file=relative_path(each.file, folder)) for each in record.outputs),
        parts=tuple(replace(each, sidecar=relative_path(each.sidecar, folder)) for each in record.parts),
    )


def _digest(file: Path) -> str:
    with translate_os_errors(file):
        return file_digest(file)


def _frames_in_progress(drawn: Generator[DrawnFrame, None, None], error: Exception) -> Iterator[DrawnFrame]:
    """End the drawing with an error, and yield the frames that are drawn already."""
    try:
        yield drawn.throw(error)
        yield from drawn
    except Exception as raised:
        if raised is not error:
            raise


def _next_frame(drawn: Iterator[DrawnFrame], number: int) -> DrawnFrame:
    """Return the next drawn frame. Raises RenderError if it does not have this number."""
    frame = next(drawn, None)
    if frame is None or frame.record.frame != number:
        got = "no frame" if frame is None else f"frame {frame.record.frame}"
        raise RenderError(
            "the executor does not draw the frames that it was given", got=got, expected=f"frame {number}"
        )
    return frame


def _store_frame(frame: DrawnFrame, *, store: FrameStore, write: WriteFrame, missing: Collection[int]) -> FrameRecord:
    """Save a drawn frame, write it to the film, and return its record with the time for both.

    missing: the numbers of the frames that the store lacks. Other frames come from the store, and are only written.
    """
    before = time.perf_counter()
    is_new = frame.record.frame in missing
    record = store.save(frame) if is_new else frame.record
    write(record.frame, frame.pictures)
    if store.is_output and not is_new:  # the frame's file was already there, so nothing was encoded
        return record
    return replace(record, seconds={**record.seconds, "encode": time.perf_counter() - before})
