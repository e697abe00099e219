"""Write a film to its output, which the job has locked: frames, the film of them, and the sidecar."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from renderer.accuracy import encoding_loss
from renderer.errors import RenderError
from renderer.film import (
    Picture,
    Pixels,
    WriteFrame,
    file_digest,
    has_frame_files,
    locked_output,
    open_film,
    picture_shape,
    require_encoder,
    translate_os_errors,
)
from renderer.job.checkpoint import FrameStore
from renderer.job.events import JobEvents
from renderer.job.executor import DrawnFrame
from renderer.job.film_accuracy import with_encoding_loss
from renderer.job.record import FilmFingerprint, FilmRecord, FrameRecord
from renderer.job.sidecar import write_sidecar
from renderer.scene import OutputSpec

# Of the frames, and their memory, that are compared with what the file keeps of them: a decoder takes as long for the
# rest as an encoder for a tenth of it.
_MAX_COMPARED, _MAX_COMPARED_BYTES = 8, 2**26


@dataclass(frozen=True)
class FilmOutput:
    """An output that a job has locked. frames: their numbers, ascending. folder: for unfinished work."""

    spec: OutputSpec
    frames: Sequence[int]
    sidecar: Path
    folder: Path
    # The first frames of the film that was written last, to compare with what the file keeps of them.
    _first_frames: list[Pixels] = field(default_factory=list)

    def write_frames(
        self,
        store: FrameStore,
        drawn: Iterator[DrawnFrame],
        label: str,
        events: JobEvents,
        defer_interrupts: Callable[[], None],
        *,
        is_overlapped: bool,
    ) -> list[FrameRecord]:
        """Make the film of the frames that the store has and of those that are drawn, and return their records.

        drawn: yields the frames that the store lacks, in their order; they are saved there.
        label: of the film or its pass, for the listener.
        defer_interrupts: called before files get their final names.
        is_overlapped: a frame is stored while the next one is drawn. Else its time counts for its frame.
        """
        missing, records = frozenset(self.frames).difference(store.records), list[FrameRecord]()
        # Where no frame is missing, the progress is that of writing them.
        shown = missing or frozenset(self.frames)
        events.started(label, len(shown))
        being_stored = list[Future[FrameRecord]]()  # at most one

        def finish(stored: Sequence[FrameRecord]) -> None:
            for record in stored:
                records.append(record)
                if record.frame in shown:
                    events.frame_finished(record)

        # However the block ends, a frame that was drawn is stored before.
        with self._open_film(store, defer_interrupts) as write, ThreadPoolExecutor(1, "hsplat-background") as thread:
            self._first_frames.clear()
            thread.submit(bool).result()  # an interrupt while the thread starts would lose its task
            for number in self.frames:
                is_new = number in missing
                frame = _next_frame(drawn, number) if is_new else store.finished_frame(number)
                stored = [each.result() for each in being_stored]
                being_stored = [thread.submit(_store_frame, frame, store, write, is_new=is_new)]
                if not is_overlapped:
                    wait(being_stored)
                finish(stored)  # a listener may end the job: this frame is being stored already
            finish([each.result() for each in being_stored])
        return records

    @contextlib.contextmanager
    def _open_film(self, store: FrameStore, defer_interrupts: Callable[[], None]) -> Iterator[WriteFrame]:
        """Yield what writes a picture to the film; nothing, where the store's pictures are the output."""
        if not store.is_output:
            film = open_film(self.spec, self.frames, staging_folder=self.folder, before_rename=defer_interrupts)
            with film as write:
                yield partial(self._write_and_remember, write)
            return
        yield lambda _number, _picture: None
        defer_interrupts()

    def _write_and_remember(self, write: WriteFrame, number: int, picture: Picture) -> None:
        write(number, picture)
        num = min(_MAX_COMPARED, max(1, _MAX_COMPARED_BYTES // math.prod(picture_shape(self.spec))))
        if len(self._first_frames) < num and not has_frame_files(self.spec):
            self._first_frames.append(picture.pixels)

    def write_record(self, record: FilmRecord, fingerprint: FilmFingerprint | None) -> FilmRecord:
        """Write the sidecar of a film, and return its record.

        fingerprint: of a film that is up to date from now on; None for one that the next job makes again. With it the
        record has the digest of a film in one file, too; frames in files have digests in their records.
        """
        record = replace(record, fingerprint=fingerprint)
        if record.accuracy is not None and self._first_frames:
            loss = encoding_loss(self.spec, len(self.frames), self._first_frames)
            record = replace(record, accuracy=with_encoding_loss(record.accuracy, loss, len(self._first_frames)))
        if fingerprint is not None and not has_frame_files(self.spec):
            with translate_os_errors(self.spec.file):
                record = replace(record, digest=file_digest(self.spec.file))
        write_sidecar(self.sidecar, record, self.folder)
        return record


@contextlib.contextmanager
def locked_film_output(spec: OutputSpec, frames: Sequence[int], sidecar: Path) -> Iterator[FilmOutput]:
    """Lock an output; raises as `renderer.film.locked_output`, and where its encoder is missing."""
    with locked_output(spec, frames, sidecar) as folder:
        require_encoder(spec)
        yield FilmOutput(spec, frames, sidecar, folder)


def _next_frame(drawn: Iterator[DrawnFrame], number: int) -> DrawnFrame:
    """Return the next frame that was drawn. Raises RenderError where it is not this one."""
    frame = next(drawn, None)
    if frame is None or frame.record.frame != number:
        got = "no frame" if frame is None else f"frame {frame.record.frame}"
        raise RenderError(
            "the executor does not draw the frames that it was given", got=got, expected=f"frame {number}"
        )
    return frame


def _store_frame(frame: DrawnFrame, store: FrameStore, write: WriteFrame, *, is_new: bool) -> FrameRecord:
    """Save a frame that was drawn, and write it to the film; return its record with the time of that."""
    if store.is_output and not is_new:
        return frame.record
    before = time.perf_counter()
    record = store.save(frame.measured()) if is_new else frame.record
    write(record.frame, frame.picture)
    return replace(record, seconds={**record.seconds, "encode": time.perf_counter() - before})
