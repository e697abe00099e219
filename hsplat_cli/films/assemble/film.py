"""The film itself: pictures that are there, encoded, or copied under new names."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import click

from hsplat_cli.films.assemble.agreement import PickedFrame, file_problems, film_problems, pick
from hsplat_cli.films.assemble.merged_sidecar import merged_record, part_notes, parts_fingerprint, parts_of
from hsplat_cli.films.assemble.parts import Part
from hsplat_cli.films.fingerprint import JobFingerprint, fingerprint_record, read_recorded_film
from hsplat_cli.terminal import counted, deferrable_interrupts, progress
from renderer.errors import InputError, SceneError
from renderer.film import (
    Picture,
    Pixels,
    frame_path,
    has_frame_files,
    locked_output,
    open_film,
    picture_shape,
    require_encoder,
    sidecar_path_of_file,
    staged_files,
    translate_os_errors,
    write_sidecar,
)
from renderer.scene import OutputSpec


def assemble_film(
    parts: Sequence[Part], numbers: Sequence[int], output: OutputSpec, *, force: bool, quiet: bool
) -> None:
    """Make the film, and its sidecar, unless they are there and it is not forced.

    Raises SceneError with all that is wrong with the parts, and what writing raises; then there is no film.
    """
    start = time.perf_counter()
    if problems := list(film_problems(parts)):
        raise SceneError(problems)  # of another film's part neither the size nor the frames tell anything
    picked, problems = pick(parts, numbers)
    sidecar = sidecar_path_of_file(output.file, numbers, parts[0].num_frames)
    with locked_output(output, numbers, sidecar) as folder, deferrable_interrupts() as defer_interrupts:
        cause = None if problems else parts_fingerprint(picked, output)
        if cause is not None and not force and _is_there(sidecar, cause, picked, output):
            if not quiet:
                click.echo(f"{output.file} is up to date; --force puts it together again", err=True)
            return
        if problems := [*problems, *file_problems(picked, picture_shape(output))]:
            raise SceneError(problems)
        require_encoder(output)
        write = _copy if has_frame_files(output) else _encode
        notes = [*write(picked, output, folder, defer_interrupts, quiet=quiet), *part_notes(picked)]
        record = merged_record(picked, output, time.perf_counter() - start) | {"notes": notes}
        if cause is not None:
            record |= fingerprint_record(cause, output)
        write_sidecar(sidecar, record, folder)
    if not quiet:
        num_parts = len(parts_of(picked))
        num = f"{counted(len(picked), 'frame')} of {counted(num_parts, 'part')}"
        click.echo(f"{output.file}: {num}")
        for note in notes:
            click.echo(f"note: {note}")
        click.echo(f"how it was made: {sidecar}")


def _is_there(sidecar: Path, cause: JobFingerprint, picked: Sequence[PickedFrame], output: OutputSpec) -> bool:
    """Whether the film is there, of the very pictures that the parts tell of.

    They need not be the same each time a part is drawn: on a budget of time they depend on the clock.
    """
    before = read_recorded_film(sidecar, output)
    if before is None or not before.is_up_to_date(cause, output, [frame.number for frame in picked]):
        return False
    digests = [record.get("digest") for record in before.records]
    return None not in digests and digests == [frame.record.get("digest") for frame in picked]


def _encode(
    picked: Sequence[PickedFrame], output: OutputSpec, folder: Path, finishing: Callable[[], None], *, quiet: bool
) -> Sequence[str]:
    """A film of the pictures; notes about it."""
    numbers = [frame.number for frame in picked]
    with open_film(output, numbers, within=folder, finishing=finishing) as film:
        for frame, content in _contents(picked, output, quiet=quiet):
            film.write(frame.number, _decoded(frame, content))
    return film.notes


def _decoded(frame: PickedFrame, content: bytes) -> Pixels:
    try:
        return Picture(png=content).pixels
    except ValueError as error:
        hint = "remove it, and draw it again by the same command as before"
        raise InputError("a frame that cannot be decoded", where=str(frame.file), hint=hint) from error


def _copy(
    picked: Sequence[PickedFrame], output: OutputSpec, folder: Path, finishing: Callable[[], None], *, quiet: bool
) -> Sequence[str]:
    """The same files under the names of the output, all at the end."""
    with staged_files(folder) as write:
        for frame, content in _contents(picked, output, quiet=quiet):
            write(frame_path(output.file, frame.number), content)
        finishing()
    return ()


def _contents(picked: Sequence[PickedFrame], output: OutputSpec, *, quiet: bool) -> Iterator[tuple[PickedFrame, bytes]]:
    with progress(len(picked), label=output.file.name, quiet=quiet) as bar:
        for frame in picked:
            with translate_os_errors(frame.file):
                content = frame.file.read_bytes()
            yield frame, content
            bar.advance()
