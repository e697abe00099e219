"""Record what became of each volume: a table for the terminal, and turntable.json for programs.

turntable.json lists all films of its folder, whichever commands made them, one after the other or at the same time. It
also has the digests by which a scene is known that nobody has edited.
"""

from __future__ import annotations

import contextlib
import json
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hsplat_cli.scenes import is_shallow
from hsplat_cli.terminal import Reporter, format_table
from renderer.errors import RenderError
from renderer.film import exclusive_lock, translate_os_errors, write_staged
from renderer.scene import read_json_object

FilmRecord = dict[str, Any]

MANIFEST_FILE = "turntable.json"
STARTED, FINISHED, INTERRUPTED = "begun", "done", "interrupted"
# Nothing of the film was touched. Shown in the table only: turntable.json keeps the record of the film before.
NOT_STARTED = "not begun"

# A process holds the lock for milliseconds. One that holds it longer than this is stopped, or its disk is gone.
LOCK_TIMEOUT_S = 60.0
# Where there is other work, and the records may be written later.
SHORT_LOCK_TIMEOUT_S = 2.0
_NOTICE_DELAY_S, _POLL_INTERVAL_S = 2.0, 0.02

# Titles of columns, and the keys of records. Turntables draw bricks, which sidecars and records count as `splats`.
_COLUMNS = {name: name for name in ("volume", "status", "kind", "frames")}
_COLUMNS |= {"bricks": "splats", "seconds": "seconds", "film": "film"}
_NUMBER_COLUMNS = (3, 4, 5)

_TEXT_KEYS = ("volume", "scene", "film", "status")  # that each record has
# The volume's path relative to the folder, without links, and the digests of what its scene's file may contain.
VOLUME_KEY, DIGESTS_KEY = "scene_of", "scene_digests"
_MAX_BYTES = 2**26  # some 500 bytes a film


class Manifest:
    """The content of turntable.json in a folder, while no other process changes it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._records, self._other_keys = _read(folder)

    def record_of(self, scene: Path) -> FilmRecord:
        """Return the record of the film of a scene; it is empty if there is none."""
        return self._records.get(scene.name, {})

    def update(self, *records: FilmRecord) -> None:
        """Write records of films in place of their former ones, and keep what is known of their scenes.

        Other records stay, except those of films whose scenes, or whose volumes where there was no scene, are gone.
        Records of films that were not started, or were interrupted before that, change nothing.
        """
        changed = [record for record in records if self._is_new_status(record)]
        if not changed:
            return
        self._records = {name: record for name, record in self._records.items() if self._is_current(name, record)}
        for record in changed:
            name = Path(record["scene"]).name
            former = self._records.pop(name, {})
            keys = (VOLUME_KEY, DIGESTS_KEY) if DIGESTS_KEY in former.keys() - record.keys() else ()
            self._records[name] = record | {key: former[key] for key in keys}
        # In ASCII even names with bytes that are no UTF-8 have a form.
        content = json.dumps({"films": [*self._records.values()]} | self._other_keys, indent=2, allow_nan=False)
        write_staged(self._folder / MANIFEST_FILE, f"{content}\n".encode())

    def _is_new_status(self, record: FilmRecord) -> bool:
        """Return whether a record says anything new about its film."""
        if record["status"] == INTERRUPTED:
            return self._records.get(Path(record["scene"]).name, {}).get("status") == STARTED
        return bool(record["status"] != NOT_STARTED)

    def _is_current(self, name: str, record: FilmRecord) -> bool:
        """Return whether the scene of a record still exists, or its volume where no scene could be made."""
        if VOLUME_KEY not in record or os.path.exists(self._folder / name):  # no error for impossible names
            return True
        volume = os.path.join(os.path.realpath(self._folder), record[VOLUME_KEY])
        return DIGESTS_KEY not in record and os.path.exists(volume)


@contextlib.contextmanager
def open_manifest(folder: Path, lock_timeout_s: float = LOCK_TIMEOUT_S) -> Iterator[Manifest]:
    """Lock turntable.json of a folder, which is made where it is missing; processes on all machines wait.

    lock_timeout_s: how long to wait for one process, which is reported after a moment. Raises InputError and
    RenderError.
    """
    file = folder / MANIFEST_FILE
    waiting_since: dict[str | None, float] = {}  # for the present holder alone: many commands take turns
    is_reported = False

    def wait(holder: str | None) -> None:
        nonlocal is_reported
        if holder not in waiting_since:
            waiting_since.clear()
        waited = time.perf_counter() - waiting_since.setdefault(holder, time.perf_counter())
        if waited >= lock_timeout_s:
            hint = "end that process, or let it finish; the same command makes only what is missing"
            raise RenderError("another process is changing this file", where=str(file), got=holder, hint=hint)
        if waited >= _NOTICE_DELAY_S and not is_reported:
            is_reported = True
            Reporter().warning(f"{file}: waiting for {holder or 'another process'}")
        time.sleep(_POLL_INTERVAL_S)

    with translate_os_errors(file):
        folder.mkdir(parents=True, exist_ok=True)
    with exclusive_lock(folder / f".{MANIFEST_FILE}.lock", wait):
        yield Manifest(folder)


def update_manifest(folder: Path, records: Sequence[FilmRecord], lock_timeout_s: float = LOCK_TIMEOUT_S) -> None:
    """Add records to turntable.json, `{"films": [...]}` with one for each scene; parameters as for `open_manifest`."""
    with open_manifest(folder, lock_timeout_s) as manifest:
        manifest.update(*records)


def _read(folder: Path) -> tuple[dict[str, FilmRecord], dict[str, Any]]:
    """Return the undamaged records by the names of their scenes, and what else is in the file.

    Both are empty where the file is damaged or is something else of that name.
    """
    data = read_json_object(folder / MANIFEST_FILE, _MAX_BYTES)
    if data is None:
        return {}, {}
    films = data.pop("films", None)
    records = filter(_is_record, films if isinstance(films, list) else [])
    other_keys = {key: value for key, value in data.items() if _is_writable(value)}
    return {Path(record["scene"]).name: record for record in records}, other_keys


def _is_record(record: Any) -> bool:
    """Return whether a record can be written again, and the keys that are used are as they were written."""
    if not isinstance(record, dict) or not _is_writable(record):
        return False
    scene_keys = [VOLUME_KEY] if record.keys() & {VOLUME_KEY, DIGESTS_KEY} else []
    digests = record.get(DIGESTS_KEY, [])
    texts = [record.get(key) for key in (*_TEXT_KEYS, *scene_keys)]
    return isinstance(digests, list) and all(isinstance(text, str) for text in (*texts, *digests))


def _is_writable(data: Any) -> bool:
    """Return whether data read from JSON can be written again: no infinities, no endless levels."""
    try:
        return is_shallow(data) and bool(json.dumps(data, allow_nan=False))
    except ValueError:
        return False


def manifest_table(records: Sequence[FilmRecord]) -> str:
    """Return a line for each volume, in columns; for a film that failed with the first line of the error."""
    return format_table([list(_COLUMNS), *map(_row, records)], right_aligned=_NUMBER_COLUMNS)


def _row(record: FilmRecord) -> list[str]:
    shown = record if record["status"] == FINISHED else record | {"film": "-"}
    if "error" in record:
        shown = shown | {"film": record["error"].splitlines()[0]}
    if "seconds" in record:
        shown = shown | {"seconds": f"{record['seconds']:.1f}"}
    return [str(shown.get(key, "-")).replace("\n", "?") for key in _COLUMNS.values()]
