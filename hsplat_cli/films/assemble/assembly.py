"""Make one film of existing frames: encode them, or copy them under new names."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from hsplat_cli.films.assemble.agreement import PickedFrame, file_problems, film_problems, pick_frames
from hsplat_cli.films.assemble.merged_sidecar import merged_record, parts_fingerprint, parts_of
from hsplat_cli.films.assemble.parts import Part
from hsplat_cli.films.film import FilmResult
from hsplat_cli.films.fingerprint import JobFingerprint, fingerprint_record
from hsplat_cli.films.resume import RecordedFilm, keep_sidecar, read_recorded_film
from hsplat_cli.terminal import Reporter, counted, deferrable_interrupts
from renderer.errors import SceneError
from renderer.film import (
    Picture,
    film_files,
    locked_output,
    open_film,
    picture_shape,
    require_encoder,
    require_no_input,
    sidecar_path_of_file,
    write_sidecar,
)
from renderer.scene import OutputSpec, is_same_file


def assemble_film(
    parts: Sequence[Part], numbers: Sequence[int], output: OutputSpec, reporter: Reporter, *, force: bool
) -> None:
    """Make the film of these frames and its sidecar, unless they are up to date; with `force` in any case.

    Raises SceneError with all that is wrong with the parts, and what writing raises; then no film is written.
    """
    start = time.perf_counter()
    sidecar = sidecar_path_of_file(output.file, numbers, parts[0].num_frames)
    # A film that was assembled among its parts is none of them.
    parts = [part for part in parts if not is_same_file(part.path, sidecar)] or parts
    require_no_input(film_files(output, numbers, sidecar), _input_files(parts))
    if problems := list(film_problems(parts)):
        raise SceneError(problems)  # the size and the frames of another film say nothing about this one
    picked, problems = pick_frames(parts, numbers)
    with locked_output(output, numbers, sidecar) as folder, deferrable_interrupts() as defer_interrupts:
        fingerprint = None if problems else parts_fingerprint(picked, output)
        recorded = None if fingerprint is None or force else _film_up_to_date(sidecar, fingerprint, picked, output)
        if recorded is not None:
            keep_sidecar(recorded, sidecar, folder)
            reporter.status(f"{output.file} is up to date; --force assembles it again")
            return
        if problems := [*problems, *file_problems(picked, picture_shape(output))]:
            raise SceneError(problems)
        require_encoder(output)
        _write(picked, output, folder, defer_interrupts, reporter)
        record = merged_record(picked, output, time.perf_counter() - start)
        if fingerprint is not None:
            record |= fingerprint_record(fingerprint, output)
        write_sidecar(sidecar, record, folder)
    num_parts = counted(len(parts_of(picked)), "part")
    FilmResult(output.file, sidecar, record, f"{counted(len(picked), 'frame')} of {num_parts}").report(reporter)


def _input_files(parts: Sequence[Part]) -> Iterator[Path]:
    for part in parts:
        yield part.path
        yield from (part.file(record["frame"]) for record in part.records)


def _film_up_to_date(
    sidecar: Path, fingerprint: JobFingerprint, picked: Sequence[PickedFrame], output: OutputSpec
) -> RecordedFilm | None:
    """Return the film if it exists and has the pictures that the parts record.

    With a time budget a part has other pictures each time it is drawn, though the fingerprint is the same.
    """
    recorded = read_recorded_film(sidecar, output)
    if recorded is None or recorded.why_stale(fingerprint, output, [frame.number for frame in picked]) is not None:
        return None
    digests = [record.get("digest") for record in recorded.frames]
    return recorded if digests == [frame.record["digest"] for frame in picked] else None


def _write(
    picked: Sequence[PickedFrame], output: OutputSpec, folder: Path, finishing: Callable[[], None], reporter: Reporter
) -> None:
    """Encode the film from the pictures, or copy them to the names of the output."""
    with (
        open_film(output, [frame.number for frame in picked], staging_folder=folder, before_rename=finishing) as write,
        reporter.progress(len(picked), label=output.file.name) as bar,
    ):
        for frame in picked:
            write(frame.number, Picture(file=frame.file))
            bar.advance()
