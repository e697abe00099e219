"""What became of each volume: a table for the terminal, and turntable.json for programs.

turntable.json tells of all films of its folder, whichever commands made them, one after the other or at the same time.
It is also how a scene that nobody has changed is known again.
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

import click

from hsplat_cli.scenes import is_shallow
from renderer.errors import RenderError
from renderer.film import exclusive_lock, translate_os_errors, write_staged
from renderer.scene import read_json_object

Record = dict[str, Any]

FILE = "turntable.json"
STARTED, DONE, INTERRUPTED = "begun", "done", "interrupted"
# Of a film of which nothing was touched. It is in the table only, for the file tells of the one before.
NOT_STARTED = "not begun"

# Who has the report has it for milliseconds. A process that has it for longer than this is stopped, or its disk gone.
PATIENCE_S = 60.0
# Where there is something else to say or to do, and what is written may be written later.
SHORT_LOCK_TIMEOUT_S = 2.0
_NOTICE_DELAY_S, _POLL_INTERVAL_S = 2.0, 0.02

# Titles, and the keys of records. What the scenes of this program draw are bricks; a sidecar counts whatever is drawn
# as `splats`, and so does the report.
_COLUMNS = {name: name for name in ("volume", "status", "kind", "frames")}
_COLUMNS |= {"bricks": "splats", "seconds": "seconds", "film": "film"}
_NUMBERS = ("frames", "bricks", "seconds")

_TEXTS = ("volume", "scene", "film", "status")  # that each record has
OF, _DIGESTS_KEY = "scene_of", "scene_digests"
_MOST_BYTES = 2**26  # a film has some 500


@dataclass(frozen=True)
class Written:
    """What is known of a scene that this program has written.

    of: its volume, relative to the folder, without links. digests: of what the file may be.
    """

    of: str
    digests: Sequence[str]

    def as_record(self) -> Record:
        """The part of a record that tells it."""
        return {OF: self.of, _DIGESTS_KEY: list(self.digests)}


class Report:
    """turntable.json of a folder, while no other process changes it."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._records, self._more = _read(folder)

    def told(self, scene: Path) -> Record | None:
        """What is told of the film of a scene."""
        return self._records.get(scene.name)

    def written(self, scene: Path) -> Written | None:
        """What this program has written there, if that is known."""
        record = self._records.get(scene.name, {})
        return Written(record[OF], record[_DIGESTS_KEY]) if _DIGESTS_KEY in record else None

    def put(self, *records: Record) -> None:
        """Write records of films in the place of those that there are; what scenes were written stays known.

        Others stay, too, but for those of films whose scenes have been removed, or whose volumes, where there was no
        scene; and those of films that were not begun, or interrupted before they were.
        """
        news = [record for record in records if self._is_new_status(record)]
        if not news:
            return
        self._records = {name: record for name, record in self._records.items() if self._is_current(name, record)}
        for record in news:
            name = Path(record["scene"]).name
            former = self._records.pop(name, {})
            known = (
                {key: former[key] for key in (OF, _DIGESTS_KEY)}
                if _DIGESTS_KEY in former.keys() - record.keys()
                else {}
            )
            self._records[name] = record | known
        # ASCII, so that also names with bytes that are no UTF-8 have a form.
        content = json.dumps({"films": [*self._records.values()]} | self._more, indent=2, allow_nan=False)
        write_staged(self._folder / FILE, f"{content}\n".encode())

    def _is_new_status(self, record: Record) -> bool:
        """Whether something has become of a film since it was told of."""
        if record["status"] == INTERRUPTED:
            return self._records.get(Path(record["scene"]).name, {}).get("status") == STARTED
        return bool(record["status"] != NOT_STARTED)

    def _is_current(self, name: str, record: Record) -> bool:
        """Whether there still is what it tells of: a scene, or a volume of which none could be made."""
        if OF not in record or os.path.exists(self._folder / name):  # no error for names that cannot be
            return True
        return _DIGESTS_KEY not in record and os.path.exists(os.path.join(os.path.realpath(self._folder), record[OF]))


class _LockWait:
    """What is done while another process changes a report: it is said after a moment, and not waited for for ever."""

    def __init__(self, file: Path, seconds: float) -> None:
        self._file, self._seconds, self._since = file, seconds, time.perf_counter()
        self._holder: str | None = None
        self._is_reported = False

    def __call__(self, holder: str | None) -> None:
        if holder != self._holder:  # of many commands each has its turn: it goes on
            self._holder, self._since = holder, time.perf_counter()
        waited = time.perf_counter() - self._since
        if waited >= self._seconds:
            hint = "end that process, or let it go on; the same command makes only what is missing"
            raise RenderError("another process is changing this file", where=str(self._file), got=holder, hint=hint)
        if waited >= _NOTICE_DELAY_S and not self._is_reported:
            self._is_reported = True
            click.echo(f"{self._file}: waiting for {holder or 'another process'}", err=True)
        time.sleep(_POLL_INTERVAL_S)


@contextlib.contextmanager
def open_manifest(folder: Path, patience_s: float = PATIENCE_S) -> Iterator[Report]:
    """turntable.json of a folder, which is made where it is missing, while other processes wait, on all machines.

    patience_s: how long to wait for one and the same process; 0 where nobody has the time.
    Raises InputError and RenderError where that cannot be.
    """
    with translate_os_errors(folder / FILE):
        folder.mkdir(parents=True, exist_ok=True)
    with exclusive_lock(folder / f".{FILE}.lock", _LockWait(folder / FILE, patience_s)):
        yield Report(folder)


def update_manifest(folder: Path, records: Sequence[Record], patience_s: float = PATIENCE_S) -> None:
    """Add records to turntable.json: `{"films": [...]}`, one for each scene; complete or not at all.

    patience_s and errors: as of `open_manifest`.
    """
    with open_manifest(folder, patience_s) as report:
        report.put(*records)


def _read(folder: Path) -> tuple[dict[str, Record], dict[str, Any]]:
    """Records by the names of their scenes, but for damaged ones, and what else is in the file.

    Nothing where the file is damaged, or is something else of that name.
    """
    data = read_json_object(folder / FILE, _MOST_BYTES)
    if data is None:
        return {}, {}
    films = data.pop("films", None)
    records = filter(_is_record, films if isinstance(films, list) else [])
    more = {key: value for key, value in data.items() if _is_writable(value)}
    return {Path(record["scene"]).name: record for record in records}, more


def _is_record(record: Any) -> bool:
    """Whether what is read again of a record is as it was written, and the rest can be."""
    if not isinstance(record, dict) or not _is_writable(record):
        return False
    digests = record.get(_DIGESTS_KEY, [])
    return (
        all(isinstance(record.get(name), str) for name in _TEXTS)
        and (_DIGESTS_KEY not in record or OF in record)
        and isinstance(record.get(OF, ""), str)
        and isinstance(digests, list)
        and all(isinstance(digest, str) for digest in digests)
    )


def _is_writable(data: Any) -> bool:
    """Whether this, read from a file of JSON, has a form there: neither infinities nor endless levels."""
    try:
        return is_shallow(data) and bool(json.dumps(data, allow_nan=False))
    except ValueError:
        return False


def table(records: Sequence[Record]) -> str:
    """A line for each volume, in columns; of a film that failed the first line of the error."""
    rows = [list(_COLUMNS), *(_row(record) for record in records)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_COLUMNS))]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if name in _NUMBERS else cell.ljust(width)
            for cell, width, name in zip(row, widths, _COLUMNS, strict=True)
        ).rstrip()
        for row in rows
    )


def _row(record: Record) -> list[str]:
    row = [str(record.get(key, "-")) for key in _COLUMNS.values()]
    if "error" in record:
        row[-1] = record["error"].splitlines()[0]
    elif record["status"] != DONE:
        row[-1] = "-"
    if "seconds" in record:
        row[list(_COLUMNS).index("seconds")] = f"{record['seconds']:.1f}"
    return [cell.replace("\n", "?") for cell in row]
