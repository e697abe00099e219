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
from dataclasses import dataclass
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
VOLUME_KEY, _DIGESTS_KEY = "scene_of", "scene_digests"
_MAX_BYTES = 2**26  # some 500 bytes a film


@dataclass(frozen=True)
class WrittenScene:
    """A scene that this program wrote.

    volume: its path relative to the folder, without links. digests: of what the file may contain.
    """

    volume: str
    digests: Sequence[str]

    def as_record(self) -> FilmRecord:
        """Return the part of a record that describes it."""
        return {VOLUME_KEY: self.volume, _DIGESTS_KEY: list(self.digests)}


class Manifest:
    """The content of turntable.json in a folder, while no other process changes it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._records, self._other_keys = _read(folder)

    def record_of(self, scene: Path) -> FilmRecord | None:
        """Return the record of the film of a scene."""
        return self._records.get(scene.name)

    def written_scene(self, scene: Path) -> WrittenScene | None:
        """Return what this program wrote to a scene file, if that is known."""
        record = self._records.get(scene.name, {})
        return WrittenScene(record[VOLUME_KEY], record[_DIGESTS_KEY]) if _DIGESTS_KEY in record else None

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
            keys = (VOLUME_KEY, _DIGESTS_KEY) if _DIGESTS_KEY in former.keys() - record.keys() else ()
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
        return _DIGESTS_KEY not in record and os.path.exists(volume)


class _LockWait:
    """Waits while another process holds the lock: reports that after a moment, and raises RenderError in the end."""

    def __init__(self, file: Path, timeout_s: float) -> None:
        self._file, self._timeout_s, self._since = file, timeout_s, time.perf_counter()
        self._holder: str | None = None
        self._is_reported = False

    def __call__(self, holder: str | None) -> None:
        if holder != self._holder:  # many commands take turns, so the wait starts again
            self._holder, self._since = holder, time.perf_counter()
        waited = time.perf_counter() - self._since
        if waited >= self._timeout_s:
            hint = "end that process, or let it finish; the same command makes only what is missing"
            raise RenderError("another process is changing this file", where=str(self._file), got=holder, hint=hint)
        if waited >= _NOTICE_DELAY_S and not self._is_reported:
            self._is_reported = True
            Reporter().warning(f"{self._file}: waiting for {holder or 'another process'}")
        time.sleep(_POLL_INTERVAL_S)


@contextlib.contextmanager
def open_manifest(folder: Path, lock_timeout_s: float = LOCK_TIMEOUT_S) -> Iterator[Manifest]:
    """Lock turntable.json of a folder, which is made where it is missing; processes on all machines wait.

    lock_timeout_s: how long to wait for one process. Raises InputError and RenderError.
    """
    with translate_os_errors(folder / MANIFEST_FILE):
        folder.mkdir(parents=True, exist_ok=True)
    wait = _LockWait(folder / MANIFEST_FILE, lock_timeout_s)
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
    digests = record.get(_DIGESTS_KEY, [])
    return (
        all(isinstance(record.get(key), str) for key in _TEXT_KEYS)
        and (_DIGESTS_KEY not in record or VOLUME_KEY in record)
        and isinstance(record.get(VOLUME_KEY, ""), str)
        and isinstance(digests, list)
        and all(isinstance(digest, str) for digest in digests)
    )


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
