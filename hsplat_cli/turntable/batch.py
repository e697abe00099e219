"""Several volumes: one process for each, one after the other, so that a failure of one does not affect the others.

The memory of a process is freed with it, and a reader that crashes ends its own film only.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from hsplat_cli.executors import ChildProcesses, describe_exit
from hsplat_cli.scenes import as_arguments, volume_file
from hsplat_cli.terminal import Reporter, counted
from hsplat_cli.turntable.manifest import (
    FINISHED,
    INTERRUPTED,
    MANIFEST_FILE,
    NOT_STARTED,
    SHORT_LOCK_TIMEOUT_S,
    FilmRecord,
    manifest_table,
    update_manifest,
)
from hsplat_cli.turntable.one_film import FilmRequest
from renderer.errors import HsplatError, RenderError
from renderer.film import require_writable

# An interrupted process removes its unfinished work. One that does not end within this time is asked again, because an
# interrupt can get lost in a library that is being loaded; after this number of times it is killed.
_TERMINATE_TIMEOUT_S, _NUM_TERMINATES = 3.0, 4


def run_batch(requests: Sequence[FilmRequest], options: Mapping[str, Any], folder: Path, reporter: Reporter) -> None:
    """Make the films, add each to turntable.json, and print a table. Raises RenderError if one of them failed.

    options: of the command line, for all of them. After an interrupt, table and file have what is finished.
    """
    require_writable(folder / MANIFEST_FILE)
    records: list[FilmRecord] = []
    pending_records: list[FilmRecord] = []  # not yet in the file
    missing: list[FilmRecord] = []  # of volumes that do not exist; each update would drop them, so each repeats them
    try:
        for number, request in enumerate(requests, start=1):
            reporter.status(f"[{number}/{len(requests)}] {volume_file(request.volume)}")
            record = _make_in_process(request, options)
            records.append(record)
            pending_records.append(record)
            if record["status"] != FINISHED:
                reporter.warning(record["error"])
                missing += [] if os.path.exists(volume_file(request.volume)) else [record]
            with suppress(HsplatError):  # the next update writes this record, too
                update_manifest(folder, [*missing, *pending_records], SHORT_LOCK_TIMEOUT_S)
                pending_records.clear()
    except KeyboardInterrupt:
        remaining = requests[len(records) :]
        interrupted = [request.record(INTERRUPTED) for request in remaining[:1]]
        reporter.result(
            manifest_table([*records, *interrupted, *(request.record(NOT_STARTED) for request in remaining[1:])])
        )
        with suppress(HsplatError):  # the interrupt is reported
            update_manifest(folder, [*missing, *pending_records, *interrupted], lock_timeout_s=0.0)
        raise
    reporter.result(manifest_table(records))
    if pending_records:
        update_manifest(folder, [*missing, *pending_records])
    num_failed = sum(record["status"] != FINISHED for record in records)
    if num_failed:
        raise RenderError(
            f"{num_failed} of {counted(len(records), 'film')} could not be made",
            where=str(folder),
            hint=f"the same command{' without --force' * requests[0].force} makes only what is missing",
        )


def _make_in_process(request: FilmRequest, options: Mapping[str, Any]) -> FilmRecord:
    """Make a film in another process; return its record, which describes the failure if there was one."""
    start = time.perf_counter()
    arguments = ["turntable", *as_arguments(dict(options)), f"--output={request.scene.parent}"]
    arguments += [f"--name={request.scene.stem}", "--", str(volume_file(request.volume))]
    with ChildProcesses() as child_processes:
        process = child_processes.start("hsplat_cli", arguments, stdout=subprocess.PIPE)
        try:
            output, _ = process.communicate()
        except KeyboardInterrupt:
            _terminate(process)
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
    seconds = {"seconds": round(time.perf_counter() - start, 3)}
    return request.record("failed") | {"exit_code": process.returncode, "error": str(error)} | seconds


def _terminate(process: subprocess.Popen[bytes]) -> None:
    """Let a process remove its unfinished work; no signal to this process has reached it."""
    for _ in range(_NUM_TERMINATES):
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(_TERMINATE_TIMEOUT_S)
            return
    process.kill()
    process.wait()
