"""Make one film of the frames of parts. Nothing is drawn, and no volume is read."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from renderer.film import film_files, sidecar_path_of_file
from renderer.job.assemble.agreement import film_problems, pick_frames
from renderer.job.assemble.merged_record import merged_record, parts_fingerprint, parts_of
from renderer.job.checkpoint import FrameStore
from renderer.job.events import JobEvents
from renderer.job.film_making import JobResult
from renderer.job.output_writer import OutputWriter, open_output
from renderer.record import (
    FilmFingerprint,
    FilmRecord,
    FinishedFilm,
    FrameFile,
    accuracy_text,
    find_finished_film,
    flicker_text,
    picture_problems,
)
from renderer.scene import OutputSpec, counted, is_same_file, raise_problems
from renderer.system import deferrable_interrupts


def assemble_film(
    parts: Sequence[FinishedFilm], numbers: Sequence[int], output: OutputSpec, events: JobEvents, *, resumes: bool
) -> JobResult:
    """Make the film of these frames and its sidecar, or return the film that is up to date.

    resumes: whether a film that is up to date is kept.
    Raises SceneError with all problems of the parts; OutputLockedError, InputError or RenderError if the output is
    locked or cannot be written. Then no film is written.
    """
    start = time.perf_counter()
    sidecar = sidecar_path_of_file(output.file, numbers, parts[0].num_path_frames)
    # A film that was assembled into the folder of its parts is no part.
    parts = [part for part in parts if not is_same_file(part.path, sidecar)] or parts
    film_files(output, numbers, sidecar).require_harmless(_input_files(parts))
    # This comes before the frames are checked, as missing frames of another film mean nothing.
    raise_problems(film_problems(parts))
    picked, problems = pick_frames(parts, numbers)
    with open_output(output, numbers, sidecar, resumes=resumes) as film:
        fingerprint = None if problems else parts_fingerprint(picked, output)
        existing = _film_up_to_date(fingerprint, picked, film, events) if fingerprint is not None and resumes else None
        if existing is not None:
            film.remove_mark()
            events.note(f"{output.file} is up to date; --force assembles it again")
            return JobResult(existing, output.file)
        raise_problems([*problems, *picture_problems(picked, output.kind)])
        record = _write(picked, fingerprint, film, start, events)
    summary = f"{counted(len(picked), 'frame')} of {counted(len(parts_of(picked)), 'part')}"
    if record.accuracy is not None:
        parts_of_line = summary, accuracy_text(record.accuracy), flicker_text(record.accuracy)
        summary = ", ".join(filter(None, parts_of_line))
    return JobResult(FinishedFilm(sidecar, record), output.file, summary)


def _input_files(parts: Sequence[FinishedFilm]) -> Iterator[Path]:
    for part in parts:
        yield part.path
        yield from (part.frame_file(number) for number in part.record.numbers)


def _film_up_to_date(
    fingerprint: FilmFingerprint, picked: Sequence[FrameFile], film: OutputWriter, events: JobEvents
) -> FinishedFilm | None:
    """Return the existing film if it has the recorded pictures of the parts; else None.

    The fingerprint alone does not show this: on a budget of seconds, a part has other pictures each time it is drawn.
    """
    existing = find_finished_film(film.sidecar, events.note)
    if existing is None or not existing.is_up_to_date(fingerprint, film.spec, film.frames):
        return None
    digests = [frame.digest for frame in existing.record.frames]
    return existing if digests == [frame.record.digest for frame in picked] else None


def _write(
    picked: Sequence[FrameFile],
    fingerprint: FilmFingerprint | None,
    film: OutputWriter,
    start: float,
    events: JobEvents,
) -> FilmRecord:
    """Encode the film from the pictures, or copy them to the names of the output, and write the sidecar."""
    files = {frame.number: frame.file for frame in picked}
    store = FrameStore(film.spec, {frame.number: frame.record for frame in picked}, lambda number, _: files[number])
    with deferrable_interrupts() as defer_interrupts:
        film.write_frames(store, (_ for _ in ()), film.spec.file.name, events, defer_interrupts, is_overlapped=True)
        record = merged_record(picked, film.spec, time.perf_counter() - start)
        return film.write_record(record, fingerprint)
