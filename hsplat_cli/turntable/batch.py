"""Makes films of several volumes. A failure of one film does not affect the others.

Large volumes are drawn one after the other, each with all threads. A small volume is drawn badly by several threads:
several processes make films of small volumes at once, each with its share of the threads. The output has the same order
in any case.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from hsplat_cli.scenes import volume_place
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable import manifest
from hsplat_cli.turntable.film_process import FilmProcesses
from hsplat_cli.turntable.film_request import FilmRequest
from hsplat_cli.turntable.gallery import Gallery
from hsplat_cli.turntable.manifest import FilmEntry
from renderer.errors import InputError, RenderError
from renderer.film import require_writable
from renderer.record import file_states
from renderer.scene import counted
from renderer.system import free_bytes, join_lines, num_cores

# The largest size, in bytes, of the files of a small volume.
_SMALL_BYTES = 1 << 24
# The free memory, in bytes, for each process that makes films of small volumes. The largest memory of a process was 0.3
# GB for 256^3 bytes, and 0.8 GB for 512^3 labels in a compressed file of 1.8 MB.
_BYTES_OF_PROCESS = 1 << 30


def run_batch(requests: Sequence[FilmRequest], arguments: Sequence[str], folder: Path, reporter: Reporter) -> None:
    """Make the films, and print a table, also after an interrupt.

    arguments: the command line of `hsplat turntable`. folder: the folder of all films. The process that makes a film
    adds it to turntable.json.

    Raises InputError if wrong inputs and locked outputs were the only reasons of failures, and RenderError if a film
    failed for another reason.
    """
    require_writable(folder / manifest.MANIFEST_FILE)
    films: list[FilmEntry] = []
    gallery, finished = Gallery(folder, reporter), _finished_films(requests, manifest.read_films(folder))
    missing = [request for request in requests if request.scene not in finished]
    processes = FilmProcesses(arguments, folder, _num_processes(missing), reporter)
    try:
        with processes:
            processes.add(missing)
            for number, request in enumerate(requests, start=1):
                reporter.status(f"[{number}/{len(requests)}] {volume_place(request.volume)}")
                if request.scene in finished:
                    reporter.status(f"{request.output} is up to date; --force draws it again")
                    films.append(finished[request.scene])
                    continue
                film = processes.make(request, gallery.grow)
                films.append(film)
                if film.error is not None:
                    reporter.warning(join_lines(film.error.splitlines()))
    finally:
        rows = [*films, *map(processes.entry, requests[len(films) :])]
        reporter.result(manifest.manifest_table(folder, rows))
        # Each update of turntable.json removes the entries of films whose scene and volume are gone.
        gone = [film for film in films if not manifest.has_volume(folder, film)]
        manifest.try_to_update(folder, gone, reporter)
    gallery.finish()
    exit_codes = [film.exit_code for film in films if film.status != manifest.FINISHED]
    if exit_codes:
        error = InputError if set(exit_codes) == {2} else RenderError
        raise error(
            f"{len(exit_codes)} of {counted(len(films), 'film')} could not be made",
            where=str(folder),
            hint=f"the same command{' without --force' * requests[0].force} makes only the missing films",
        )


def _num_processes(requests: Sequence[FilmRequest]) -> int:
    """Return the number of processes that make some films at once: more than one only if all volumes are small.

    Each process is to make at least two films, since it takes longer to start than a small film takes to be made.
    """
    if not all(map(_is_small, requests)):
        return 1
    return int(max(1, min(num_cores(), len(requests) // 2, free_bytes() / _BYTES_OF_PROCESS)))


def _is_small(request: FilmRequest) -> bool:
    """Return whether a film is drawn by its process, from volumes in files of few bytes.

    A folder may be a store, whose size is not known; nor is it at a URL.
    """
    volumes = filter(None, (request.volume, request.film.under))
    if request.executor.scheduler is not None or not all(os.path.isfile(volume_place(each)) for each in volumes):
        return False
    return sum(state[0] for _, state in file_states(request.input_files()) if state) <= _SMALL_BYTES


def _finished_films(requests: Iterable[FilmRequest], known: Mapping[str, FilmEntry]) -> dict[Path, FilmEntry]:
    """Return the entries of the films that are up to date, by the paths of their scenes.

    known: the entries of turntable.json, by the names of scenes.
    """
    entries = [(request, known.get(request.scene.name)) for request in requests]
    return {request.scene: film for request, film in entries if film is not None and _is_up_to_date(film, request)}


def _is_up_to_date(film: FilmEntry, request: FilmRequest) -> bool:
    """Return whether the states of files (sizes and times) show that a film is up to date, without reading voxels."""
    if request.force or film.made_by is None or film.status != manifest.FINISHED:
        return False
    return film.made_by == request.fingerprint(file_states(request.input_files())).digest
