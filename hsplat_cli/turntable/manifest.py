"""Record what became of each volume: a table for the terminal, and turntable.json for programs.

turntable.json lists all films of its folder, whichever commands made them, one after the other or at the same time.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from hsplat_cli.terminal import Reporter, format_table
from renderer.errors import HsplatError, OutputLockedError, RenderError
from renderer.film import lock_slots, write_staged
from renderer.scene import counted, found_path, is_plain_data, read_json_object

FilmEntry = dict[str, Any]

MANIFEST_FILE = "turntable.json"
LOCK_FILE = f".{MANIFEST_FILE}.lock"
STARTED, FINISHED, FAILED, INTERRUPTED = "begun", "done", "failed", "interrupted"
# Nothing of the film was touched. Shown in the table only: turntable.json keeps the record of the film before.
NOT_STARTED = "not begun"

# A process holds the lock for milliseconds. One that holds it longer than this is stopped, or its disk is gone.
LOCK_TIMEOUT_S = 60.0
_SHORT_LOCK_TIMEOUT_S = 1.0
_NOTICE_DELAY_S, _POLL_INTERVAL_S = 2.0, 0.02

# Titles of columns, and the keys of records.
_COLUMNS = {name: name for name in ("volume", "status", "kind", "frames", "primitives", "seconds")}
# The column of faults of pictures is left out where no film has any.
_COLUMNS |= {"file PSNR": "file_psnr", "frames PSNR": "psnr", "seen": "seen", "film": "film"}
_NUMBER_COLUMNS = ("frames", "primitives", "seconds", "file_psnr", "psnr")
NUMBER_KEYS, _TOO_LARGE = ("psnr", "file_psnr", "seconds"), 1e9

_TEXT_KEYS = ("volume", "scene", "film", "status")  # that each record has
# More levels than a record of a film has.
_MOST_LEVELS = 10
_MAX_BYTES = 2**26  # some 500 bytes a film


def update_manifest(
    folder: Path, records: Sequence[FilmEntry], reporter: Reporter, lock_timeout_s: float = LOCK_TIMEOUT_S
) -> None:
    """Write records of films to turntable.json, `{"films": [...]}`, in place of the former records of their scenes.

    Other records stay, except those of films whose scenes, or whose volumes where no film could be made, are gone.
    Records of films that were not started, or were interrupted before that, change nothing.

    lock_timeout_s: how long to wait for other processes, on all machines. Raises InputError and RenderError.
    """
    with locked_manifest(folder, reporter, lock_timeout_s):
        stored = _stored_records(folder)
        films = _by_scene(stored)
        changed = {
            record["scene"]: record
            for record in records
            if record["status"] != NOT_STARTED
            and (record["status"] != INTERRUPTED or films.get(record["scene"], {}).get("status") == STARTED)
        }
        if not changed:
            return
        if num_left_out := sum(not _is_record(record) for record in stored):
            left_out = f"{counted(num_left_out, 'record')} left out: damaged, or of another version of hsplat"
            reporter.warning(f"{folder / MANIFEST_FILE}: {left_out}")
        kept = {name: record for name, record in films.items() if name in changed or _is_current(folder, record)}
        # In ASCII even names with bytes that are no UTF-8 have a form.
        content = json.dumps({"films": list((kept | changed).values())}, indent=2, allow_nan=False)
        write_staged(folder / MANIFEST_FILE, f"{content}\n".encode())


def try_to_update(folder: Path, records: Sequence[FilmEntry], reporter: Reporter) -> None:
    """Write records where there is another error to report: wait for a moment only, and raise nothing."""
    with contextlib.suppress(HsplatError):
        update_manifest(folder, records, reporter, _SHORT_LOCK_TIMEOUT_S)


@contextlib.contextmanager
def locked_manifest(folder: Path, reporter: Reporter, timeout_s: float) -> Iterator[None]:
    """Lock turntable.json of a folder, which is made where it is missing; a wait is reported after a moment."""
    file, start, is_reported = folder / MANIFEST_FILE, time.perf_counter(), False
    with contextlib.ExitStack() as stack:
        while True:
            try:
                stack.enter_context(lock_slots(folder, [0], file, shared_file=LOCK_FILE))
                break
            except OutputLockedError as error:
                waited = time.perf_counter() - start
                if waited >= timeout_s:
                    hint = "end that process, or let it finish; the same command makes only what is missing"
                    what = "another process is changing this file"
                    raise RenderError(what, where=str(file), got=error.got, hint=hint) from error
                if waited >= _NOTICE_DELAY_S and not is_reported:
                    is_reported = True
                    reporter.warning(f"{file}: waiting for {error.got or 'another process'}")
            time.sleep(_POLL_INTERVAL_S)
        yield


def read_films(folder: Path) -> dict[str, FilmEntry]:
    """Return the undamaged records by the names of their scenes; none where the file is something else.

    Their paths are relative to the folder.
    """
    return _by_scene(_stored_records(folder))


def _stored_records(folder: Path) -> list[Any]:
    films = (read_json_object(folder / MANIFEST_FILE, _MAX_BYTES) or {}).get("films")
    return films if isinstance(films, list) else []


def _by_scene(records: Sequence[Any]) -> dict[str, FilmEntry]:
    return {record["scene"]: record for record in records if _is_record(record)}


def _is_record(record: Any) -> bool:
    """Return whether a record can be written again, and the keys that are used are as they were written."""
    try:
        is_writable = is_plain_data(record, _MOST_LEVELS) and bool(json.dumps(record, allow_nan=False))
    except ValueError:  # infinities
        return False
    if not (is_writable and isinstance(record, dict) and all(isinstance(record.get(key), str) for key in _TEXT_KEYS)):
        return False
    name: str = record["scene"]
    return os.path.basename(name) == name


def _is_current(folder: Path, record: FilmEntry) -> bool:
    """Return whether the scene of a record still exists, or its volume where no film could be made."""
    if os.path.exists(folder / record["scene"]):  # no error for impossible names
        return True
    return record["status"] == FAILED and has_volume(folder, record)


def has_volume(folder: Path, record: FilmEntry) -> bool:
    """Return whether the volume of a record still exists."""
    return os.path.exists(found_path(record["volume"], folder))


def manifest_table(folder: Path, records: Sequence[FilmEntry]) -> str:
    """Return a line for each volume, in columns; for a film that failed with the first line of the error."""
    has_seen = any(record.get("seen") for record in records)
    columns = {title: key for title, key in _COLUMNS.items() if has_seen or key != "seen"}
    rows = [_row(folder, record, columns.values()) for record in records]
    numbers = [number for number, key in enumerate(columns.values()) if key in _NUMBER_COLUMNS]
    return format_table([list(columns), *rows], right_aligned=numbers)


def _row(folder: Path, record: FilmEntry, keys: Iterable[str]) -> list[str]:
    shown = record | {key: short_number(record.get(key)) or "-" for key in NUMBER_KEYS}
    shown |= {key: os.path.normpath(folder / record[key]) for key in ("volume", "film")}
    if record["status"] != FINISHED:
        shown["film"] = record.get("error", "-").splitlines()[0]
    return [str(shown.get(key, "-")) for key in keys]


def short_number(value: Any) -> str:
    """Return a number of a record with one decimal; empty for anything else."""
    return f"{value:.1f}" if isinstance(value, (int, float)) and abs(value) < _TOO_LARGE else ""
