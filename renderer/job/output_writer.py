"""Write a film to its output, which the job has locked: frames, the film of them, and the sidecar."""

from __future__ import annotations

import contextlib
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from renderer.accuracy import MOST_DB, encoding_loss, psnr
from renderer.errors import RenderError
from renderer.film import (
    Picture,
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
from renderer.record.accuracy_records import with_encoding_loss
from renderer.record.film_record import FilmFingerprint, FilmRecord, FrameRecord, OutputRecord
from renderer.record.own_files import naming_mark, require_own_files
from renderer.record.sidecar import write_sidecar
from renderer.scene import OutputFile, OutputSpec, relative_path, with_files
from renderer.system import start_threads

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
    # The first pictures of each file that was written last, to compare with what a film keeps of them.
    first_pictures: dict[Path, list[Picture]] = field(default_factory=dict)

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

        files = self.shown[1:] if store.is_output else self.shown  # where the store's pictures are the first

        def before_rename() -> None:
            defer_interrupts()
            if self.shown[1:]:
                write_staged(naming_mark(self.spec, self.sidecar), b"", self.folder)

        films = open_films(files, self.spec.kinds, is_locked=True, before_rename=before_rename)
        # However the block ends, a frame that was drawn is stored before, unless its exact rays are interrupted.
        with films as write_to_films, start_threads(1, "hsplat-background") as thread:
            write = partial(self._write_and_remember, write_to_films)
            self.first_pictures.clear()
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

    @property
    def shown(self) -> list[OutputFile]:
        """Return the files that have any of the frames."""
        return self.spec.shown(self.frames)

    def _write_and_remember(self, write: WriteFrame, number: int, pictures: Mapping[int, Picture]) -> None:
        write(number, pictures)
        kinds = self.spec.kinds
        for each in (each for each in self.spec.files if each.shows(number)):
            first = self.first_pictures.setdefault(each.file, [])
            num_bytes = math.prod(each.kind.shape) * each.kind.depth // 8
            if len(first) < min(_MAX_COMPARED, max(1, _MAX_COMPARED_BYTES // num_bytes)):
                first.append(pictures[kinds.index(each.kind)])

    def write_record(self, record: FilmRecord, fingerprint: FilmFingerprint | None) -> FilmRecord:
        """Write the sidecar of a film, and return its record, in which files are relative to the sidecar.

        fingerprint: of a film that is up to date from now on; None for one that the next job makes again. With it the
        record has the digests of films in one file, too; frames in files have digests in their records.
        """
        films, accuracy = [each for each in self.shown if not each.is_frames], record.accuracy
        digests = {} if fingerprint is None else {each.file: _digest(each.file) for each in films}
        losses = {} if accuracy is None else {each.file: self._loss(each) for each in films}
        if accuracy is not None and self.spec.file in losses:
            num_compared = len(self.first_pictures[self.spec.file])
            accuracy = with_encoding_loss(accuracy, losses[self.spec.file], num_compared)
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
        write_sidecar(self.sidecar, record, self.folder)
        self.remove_mark()
        return record

    def remove_mark(self) -> None:
        """Take note that the sidecar describes the files that there are."""
        with translate_os_errors(self.sidecar):
            naming_mark(self.spec, self.sidecar).unlink(missing_ok=True)

    def _loss(self, output: OutputFile) -> float:
        first = [picture.pixels for picture in self.first_pictures[output.file]]
        return encoding_loss(output, sum(map(output.shows, self.frames)), first)


@contextlib.contextmanager
def locked_film_output(
    spec: OutputSpec, frames: Sequence[int], sidecar: Path, *, resumes: bool
) -> Iterator[FilmOutput]:
    """Lock an output; raises as `renderer.film.locked_output`, and where its encoder is missing.

    resumes: raises InputError where files that the film has not made have the names of its files.
    """
    with locked_output(spec, frames, sidecar) as folder:
        if resumes:
            require_own_files(spec, frames, sidecar)
        require_encoder(spec)
        yield FilmOutput(spec, frames, sidecar, folder)


def _relative_to(folder: Path, record: FilmRecord) -> FilmRecord:
    """Return a record in which the names of files are relative to a folder."""
    return replace(
        record,
        scene=with_files(record.scene, lambda _, file: relative_path(file, folder)),
        outputs=tuple(replace(each, file=relative_path(each.file, folder)) for each in record.outputs),
        parts=tuple(replace(each, sidecar=relative_path(each.sidecar, folder)) for each in record.parts),
    )


def _digest(file: Path) -> str:
    with translate_os_errors(file):
        return file_digest(file)


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
    before = time.perf_counter()
    frame = frame.finished()
    record = store.save(frame) if is_new else frame.record
    write(record.frame, frame.pictures)
    if store.is_output and not is_new:  # its picture is where it belongs
        return record
    return replace(record, seconds={**record.seconds, "encode": time.perf_counter() - before})
