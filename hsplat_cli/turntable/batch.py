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
from pathlib import Path

from hsplat_cli.scenes import volume_file
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable import manifest
from hsplat_cli.turntable.gallery import Gallery
from hsplat_cli.turntable.manifest import FilmEntry
from hsplat_cli.turntable.one_film import FilmRequest
from hsplat_cli.turntable.up_to_date import up_to_date_record
from renderer.errors import InputError, RenderError
from renderer.film import require_writable
from renderer.record import round_seconds
from renderer.scene import counted
from renderer.system import ChildProcesses, describe_exit, join_lines

# Time in which an interrupted process must remove its unfinished work and end. Then it is killed: a library that is
# being loaded can lose an interrupt.
_TERMINATE_TIMEOUT_S = 10.0


def run_batch(requests: Sequence[FilmRequest], arguments: Sequence[str], folder: Path, reporter: Reporter) -> None:
    """Make the films, and print a table, also after an interrupt.

    arguments: of the command line, for all films. Each process adds its film to turntable.json. Raises InputError if
    wrong inputs and locked outputs were the only reasons of failures, and RenderError if a film failed otherwise.
    """
    require_writable(folder / manifest.MANIFEST_FILE)
    records: list[FilmEntry] = []
    gallery, earlier = Gallery(folder, reporter), manifest.read_films(folder)
    try:
        for number, request in enumerate(requests, start=1):
            reporter.status(f"[{number}/{len(requests)}] {volume_file(request.volume)}")
            if (known := up_to_date_record(request, earlier)) is not None:
                reporter.status(f"{request.output} is up to date; --force draws it again")
                records.append(known)
                continue
            records.append(_make_in_process(request, arguments, reporter))
            if records[-1]["status"] != manifest.FINISHED:
                reporter.warning(join_lines(records[-1]["error"].splitlines()))
            gallery.grow()
    finally:
        remaining = requests[len(records) :]
        statuses = [manifest.INTERRUPTED, *[manifest.NOT_STARTED] * len(remaining)]
        rows = [request.record(status) for request, status in zip(remaining, statuses, strict=False)]
        reporter.result(manifest.manifest_table(folder, [*records, *rows]))
        # Each update removes the records of films whose scene and volume are gone.
        missing = [record for record in records if not manifest.has_volume(folder, record)]
        manifest.try_to_update(folder, missing, reporter)
    gallery.finish()
    exit_codes = [record.get("exit_code") for record in records if record["status"] != manifest.FINISHED]
    if exit_codes:
        error = InputError if set(exit_codes) == {2} else RenderError
        raise error(
            f"{len(exit_codes)} of {counted(len(records), 'film')} could not be made",
            where=str(folder),
            hint=f"the same command{' without --force' * requests[0].force} makes only the missing films",
        )


def _make_in_process(request: FilmRequest, arguments: Sequence[str], reporter: Reporter) -> FilmEntry:
    """Make a film in another process; return its record, or a record of the failure."""
    start = time.perf_counter()
    of_film = [f"--name={request.scene.stem}", "--", str(volume_file(request.volume))]
    with ChildProcesses() as child_processes:
        process = child_processes.start("hsplat_cli", ["turntable", *arguments, *of_film], stdout=subprocess.PIPE)
        try:
            output, _ = process.communicate()
        except KeyboardInterrupt:  # the process has not received the signal
            process.terminate()
            with suppress(subprocess.TimeoutExpired):
                process.wait(_TERMINATE_TIMEOUT_S)
            raise
    with suppress(ValueError):
        record = json.loads(output.strip().rpartition(b"\n")[2])
        if isinstance(record, dict):
            return record
    # The process ended before it could print a record.
    error = RenderError(
        "the process that made this film ended early",
        where=str(volume_file(request.volume)),
        got=describe_exit(process.returncode),
        hint="where memory runs out the system sends this signal" if process.returncode == -signal.SIGKILL else None,
    )
    seconds = {"seconds": round_seconds(time.perf_counter() - start)}
    record = request.failure_record(error) | {"exit_code": process.returncode} | seconds
    manifest.try_to_update(request.scene.parent, [record], reporter)
    return record
