"""Several volumes: a process for each, one after the other, so that nothing that happens to one concerns the others.

Memory that a process had is gone with it, and a reader that crashes takes down its own film only.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import click

from hsplat_cli.film_options import as_arguments
from hsplat_cli.scene_text import volume_file
from hsplat_cli.turntable.report import table, write_report
from hsplat_cli.turntable.single import Order, Record
from renderer.errors import RenderError
from renderer.staging import require_writable

# A process that was interrupted removes what is unfinished. One that does not end within this time is asked again, as
# an interrupt can get lost in a library that is being loaded, so many times in all; then it is killed.
_PATIENCE_S, _NUM_ASKED = 3.0, 4

# What a process runs, its first argument being where this program was imported from: `python -m hsplat_cli`, but with
# no look for modules in the current folder, in which a scan may lie beside a numpy.py.
_CODE = Path(__file__).resolve().parents[2]
_START = """\
import sys
code = sys.argv.pop(1)
sys.path[:1] = [] if code in sys.path[1:] else [code]
from hsplat_cli.__main__ import main
main()
"""


def run_batch(orders: Sequence[Order], options: Mapping[str, Any], folder: Path, *, quiet: bool) -> None:
    """Make the films, print a table, write the report. Raises RenderError if one of them failed.

    options: of the command line, for all of them. After an interrupt table and report tell what there is.
    """
    require_writable(folder / "turntable.json")
    records: list[Record] = []
    try:
        for number, order in enumerate(orders, start=1):
            if not quiet:
                click.echo(f"[{number}/{len(orders)}] {volume_file(order.volume)}", err=True)
            records.append(_made(order, options))
            if records[-1]["status"] != "done":
                click.echo(records[-1]["error"], err=True)
    except KeyboardInterrupt:
        interrupted = [orders[len(records)].record("interrupted")] if len(records) < len(orders) else []
        _finish([*records, *interrupted, *(order.record("not begun") for order in orders[len(records) + 1 :])], folder)
        raise
    _finish(records, folder)
    num_failed = sum(record["status"] != "done" for record in records)
    if num_failed:
        raise RenderError(f"{num_failed} of {len(records)} films could not be made", where=str(folder))


def _finish(records: Sequence[Record], folder: Path) -> None:
    write_report(folder, records)
    click.echo(table(records))


def _made(order: Order, options: Mapping[str, Any]) -> Record:
    """The record of a film that another process has made, or failed to make."""
    start = time.perf_counter()
    process = _process(order, options)
    try:
        said, _ = process.communicate()
    except KeyboardInterrupt:
        _end(process)
        _sweep(order, process)
        raise
    with suppress(ValueError):
        record = json.loads(said.strip().rpartition("\n")[2])
        if isinstance(record, dict):
            return record
    # It did not come to say what was wrong, nor to put away what was unfinished.
    _sweep(order, process)
    seconds = {"seconds": round(time.perf_counter() - start, 3)}
    return order.record("failed") | {"exit_code": process.returncode, "error": _epitaph(order, process)} | seconds


def _process(order: Order, options: Mapping[str, Any]) -> subprocess.Popen[str]:
    arguments = ["turntable", *as_arguments(dict(options)), f"--output={order.scene.parent}"]
    arguments += [f"--name={order.scene.stem}", "--", str(volume_file(order.volume))]
    # LIFELINE: here the process gets what lets it notice that this one has been killed.
    return subprocess.Popen(
        [sys.executable, "-c", _START, str(_CODE), *arguments],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        encoding="utf-8",
        errors="replace",
    )


def _end(process: subprocess.Popen[str]) -> None:
    """Let a process put away what is unfinished. Ctrl-C on a terminal has reached it, too; a signal to this one alone
    has not."""
    for _ in range(_NUM_ASKED):
        process.terminate()
        with suppress(subprocess.TimeoutExpired):
            process.wait(_PATIENCE_S)
            return
    process.kill()
    process.wait()


def _sweep(order: Order, process: subprocess.Popen[str]) -> None:
    """Remove the temporary files (`renderer.staging`) of a process that was ended before it could."""
    for folder in {order.scene.parent, order.output.parent}:
        for path in folder.glob(f".*.partial-{process.pid}"):
            with suppress(OSError):
                path.unlink()


def _epitaph(order: Order, process: subprocess.Popen[str]) -> str:
    code = process.returncode
    if code >= 0:
        got = f"exit code {code}"
    else:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else str(-code)
        got = f"killed by {name}" + (", perhaps for want of memory" if -code == signal.SIGKILL else "")
    return str(
        RenderError("the process that made this film ended early", where=str(volume_file(order.volume)), got=got)
    )
