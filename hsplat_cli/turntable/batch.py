"""Makes films of several volumes, each in its own process, so that a failure of one film does not affect the others.

The memory of a process is freed at its end, and a reader that crashes ends only its own film.
"""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from hsplat_cli.scenes import volume_file
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable import manifest
from hsplat_cli.turntable.film_request import FilmRequest
from hsplat_cli.turntable.gallery import Gallery
from hsplat_cli.turntable.manifest import FilmEntry
from renderer.errors import InputError, RenderError
from renderer.film import require_writable
from renderer.record import field_types as types, file_states, round_seconds
from renderer.scene import counted
from renderer.system import ChildProcesses, describe_exit, join_lines

# Seconds that an interrupted process has to remove its unfinished work and end. After them it is killed: a library that
# is being loaded can lose an interrupt.
_TERMINATE_TIMEOUT_S = 10.0


def run_batch(requests: Sequence[FilmRequest], arguments: Sequence[str], folder: Path, reporter: Reporter) -> None:
    """Make the films, and print a table, also after an interrupt.

    arguments: the options of the command line, for all films. folder: the folder of all films. Each process adds its
    film to turntable.json. Raises InputError if wrong inputs and locked outputs were the only reasons of failures, and
    RenderError if a film failed for another reason.
    """
    require_writable(folder / manifest.MANIFEST_FILE)
    films: list[FilmEntry] = []
    gallery, earlier = Gallery(folder, reporter), manifest.read_films(folder)
    try:
        for number, request in enumerate(requests, start=1):
            reporter.status(f"[{number}/{len(requests)}] {volume_file(request.volume)}")
            known = earlier.get(request.scene.name)
            if known is not None and _is_up_to_date(known, request):
                reporter.status(f"{request.output} is up to date; --force draws it again")
                films.append(known)
                continue
            film = _make_in_process(request, arguments, reporter)
            films.append(film)
            if film.error is not None:
                reporter.warning(join_lines(film.error.splitlines()))
            gallery.grow()
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


def _make_in_process(request: FilmRequest, arguments: Sequence[str], reporter: Reporter) -> FilmEntry:
    """Make a film in another process; return its entry in turntable.json, or an entry on its failure."""
    start = time.perf_counter()
    of_film = [f"--name={request.scene.stem}", "--", str(volume_file(request.volume))]
    with ChildProcesses() as child_processes:
        process = child_processes.start("hsplat_cli", ["turntable", *arguments, *of_film], stdout=subprocess.PIPE)
        try:
            output, _ = process.communicate()
        except KeyboardInterrupt:  # the film's process has not received the signal
            process.terminate()
            with suppress(subprocess.TimeoutExpired):
                process.wait(_TERMINATE_TIMEOUT_S)
            raise
    with suppress(ValueError):
        film = types.read_record(manifest.FILM_ENTRY, json.loads(output.strip().rpartition(b"\n")[2]))
        if film is not None:
            return film
    # The process ended before it could print an entry.
    error = RenderError(
        "the process that made this film ended early",
        where=str(volume_file(request.volume)),
        got=describe_exit(process.returncode),
        hint="where memory runs out the system sends this signal" if process.returncode == -signal.SIGKILL else None,
    )
    seconds = round_seconds(time.perf_counter() - start)
    failure = replace(request.failure(error), exit_code=process.returncode, seconds=seconds)
    manifest.try_to_update(request.scene.parent, [failure], reporter)
    return failure
