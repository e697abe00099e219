"""Several volumes: a process for each, one after the other, so that nothing that happens to one concerns the others.

Memory that a process had is gone with it, and a reader that crashes takes down its own film only.
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

import click

from hsplat_cli.executors import ChildProcesses
from hsplat_cli.scenes import as_arguments, volume_file
from hsplat_cli.terminal import counted
from hsplat_cli.turntable.manifest import (
    DONE,
    FILE,
    INTERRUPTED,
    NOT_STARTED,
    SHORT_LOCK_TIMEOUT_S,
    Record,
    table,
    update_manifest,
)
from hsplat_cli.turntable.one_film import Order
from renderer.errors import HsplatError, RenderError
from renderer.film import require_writable

# A process that was interrupted removes what is unfinished. One that does not end within this time is asked again, as
# an interrupt can get lost in a library that is being loaded, so many times in all; then it is killed.
_PATIENCE_S, _NUM_TERMINATES = 3.0, 4


def run_batch(orders: Sequence[Order], options: Mapping[str, Any], folder: Path, *, quiet: bool) -> None:
    """Make the films, add each to the report, print a table. Raises RenderError if one of them failed.

    options: of the command line, for all of them. After an interrupt table and report tell what there is.
    """
    require_writable(folder / FILE)
    records: list[Record] = []
    pending_records: list[Record] = []  # others are no more this command's to write
    missing: list[Record] = []  # but those that are forgotten whenever something is: of volumes that are not there
    try:
        for number, order in enumerate(orders, start=1):
            if not quiet:
                click.echo(f"[{number}/{len(orders)}] {volume_file(order.volume)}", err=True)
            record = _made(order, options)
            records.append(record)
            pending_records.append(record)
            if record["status"] != DONE:
                click.echo(record["error"], err=True)
                missing += [] if os.path.exists(volume_file(order.volume)) else [record]
            with suppress(HsplatError):  # the next one may be written, and with it this one
                update_manifest(folder, [*missing, *pending_records], SHORT_LOCK_TIMEOUT_S)
                pending_records.clear()
    except KeyboardInterrupt:
        interrupted = [order.record(INTERRUPTED) for order in orders[len(records) :][:1]]
        click.echo(
            table([*records, *interrupted, *(order.record(NOT_STARTED) for order in orders[len(records) + 1 :])])
        )
        with suppress(HsplatError):  # the interrupt is what is said
            update_manifest(folder, [*missing, *pending_records, *interrupted], patience_s=0.0)
        raise
    click.echo(table(records))
    if pending_records:
        update_manifest(folder, [*missing, *pending_records])
    num_failed = sum(record["status"] != DONE for record in records)
    if num_failed:
        raise RenderError(
            f"{num_failed} of {counted(len(records), 'film')} could not be made",
            where=str(folder),
            hint=f"the same command{' without --force' * orders[0].force} makes only what is missing",
        )


def _made(order: Order, options: Mapping[str, Any]) -> Record:
    """The record of a film that another process has made, or failed to make."""
    start = time.perf_counter()
    with ChildProcesses() as child_processes:
        process = _process(order, options, child_processes)
        try:
            said, _ = process.communicate()
        except KeyboardInterrupt:
            _end(process)
            raise
    with suppress(ValueError):
        record = json.loads(said.strip().rpartition(b"\n")[2])
        if isinstance(record, dict):
            return record
    # It did not come to say what was wrong.
    seconds = {"seconds": round(time.perf_counter() - start, 3)}
    return order.record("failed") | {"exit_code": process.returncode, "error": _exit_error(order, process)} | seconds


def _process(order: Order, options: Mapping[str, Any], child_processes: ChildProcesses) -> subprocess.Popen[bytes]:
    arguments = ["turntable", *as_arguments(dict(options)), f"--output={order.scene.parent}"]
    arguments += [f"--name={order.scene.stem}", "--", str(volume_file(order.volume))]
    return child_processes.start("hsplat_cli", arguments, stdout=subprocess.PIPE)


def _end(process: subprocess.Popen[bytes]) -> None:
    """Let a process put away what is unfinished; no signal to this one has reached it."""
    for _ in range(_NUM_TERMINATES):
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(_PATIENCE_S)
            return
    process.kill()
    process.wait()


def _exit_error(order: Order, process: subprocess.Popen[bytes]) -> str:
    code = process.returncode
    if code >= 0:
        got = f"exit code {code}"
    else:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else str(-code)
        got = f"killed by {name}" + (", perhaps for want of memory" if -code == signal.SIGKILL else "")
    return str(
        RenderError("the process that made this film ended early", where=str(volume_file(order.volume)), got=got)
    )
