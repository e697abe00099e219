"""Makes films of several volumes, one after the other. A failure of one film does not affect the others."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hsplat_cli.scenes import volume_place
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable import manifest
from hsplat_cli.turntable.film_process import FilmProcess
from hsplat_cli.turntable.film_request import FilmRequest
from hsplat_cli.turntable.gallery import Gallery
from hsplat_cli.turntable.manifest import FilmEntry
from renderer.errors import InputError, RenderError
from renderer.film import require_writable
from renderer.record import file_states
from renderer.scene import counted
from renderer.system import join_lines


def run_batch(requests: Sequence[FilmRequest], arguments: Sequence[str], folder: Path, reporter: Reporter) -> None:
    """Make the films, and print a table, also after an interrupt.

    arguments: the command line of `hsplat turntable`. folder: the folder of all films. The process that makes a film
    adds it to turntable.json.

    Raises InputError if wrong inputs and locked outputs were the only reasons of failures, and RenderError if a film
    failed for another reason.
    """
    require_writable(folder / manifest.MANIFEST_FILE)
    films: list[FilmEntry] = []
    gallery, earlier = Gallery(folder, reporter), manifest.read_films(folder)
    try:
        with FilmProcess(arguments, folder, reporter) as process:
            for number, request in enumerate(requests, start=1):
                reporter.status(f"[{number}/{len(requests)}] {volume_place(request.volume)}")
                known = earlier.get(request.scene.name)
                if known is not None and _is_up_to_date(known, request):
                    reporter.status(f"{request.output} is up to date; --force draws it again")
                    films.append(known)
                    continue
                film = process.make(request, gallery.grow)
                films.append(film)
                if film.error is not None:
                    reporter.warning(join_lines(film.error.splitlines()))
    finally:
        remaining = requests[len(films) :]
        rows = [
            request.entry(manifest.NOT_STARTED if number else manifest.INTERRUPTED)
            for number, request in enumerate(remaining)
        ]
        reporter.result(manifest.manifest_table(folder, [*films, *rows]))
        # Each update of turntable.json removes the entries of films whose scene and volume are gone.
        missing = [film for film in films if not manifest.has_volume(folder, film)]
        manifest.try_to_update(folder, missing, reporter)
    gallery.finish()
    exit_codes = [film.exit_code for film in films if film.status != manifest.FINISHED]
    if exit_codes:
        error = InputError if set(exit_codes) == {2} else RenderError
        raise error(
            f"{len(exit_codes)} of {counted(len(films), 'film')} could not be made",
            where=str(folder),
            hint=f"the same command{' without --force' * requests[0].force} makes only the missing films",
        )


def _is_up_to_date(film: FilmEntry, request: FilmRequest) -> bool:
    """Return whether the states of files (sizes and times) show that a film is up to date, without reading voxels."""
    if request.force or film.made_by is None or film.status != manifest.FINISHED:
        return False
    return film.made_by == request.fingerprint(file_states(request.input_files())).digest
