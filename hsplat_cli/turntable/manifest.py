"""Record the result for each volume: a table for the terminal, and turntable.json for programs.

turntable.json lists all films of its folder, whichever commands made them, one after the other or at the same time.
The file may have been edited by hand: damaged entries are skipped.
"""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from hsplat_cli.terminal import Reporter, format_table
from renderer.errors import HsplatError, InputError, OutputLockedError, RenderError
from renderer.film import lock_slots, translate_os_errors
from renderer.record import RecordFile, field_types as types, record_to_json
from renderer.scene import counted, found_path, is_url, join_some, schema

MANIFEST_FILE = "turntable.json"
LOCK_FILE = f".{MANIFEST_FILE}.lock"

Status = Literal["begun", "done", "failed", "interrupted", "not begun"]
STARTED: Final = "begun"
FINISHED: Final = "done"
FAILED: Final = "failed"
INTERRUPTED: Final = "interrupted"
# The status of a film none of whose files were touched. Only the terminal's table shows it: turntable.json keeps the
# entry of the earlier film.
NOT_STARTED: Final = "not begun"

# The longest time, in seconds, for which a process waits for the lock of turntable.json. A process holds the lock for
# milliseconds; a process that holds it for longer than this was stopped, or its disk is gone.
LOCK_TIMEOUT_S = 60.0
# The longest wait for the lock of turntable.json, in seconds, where another error is to be reported.
_SHORT_LOCK_TIMEOUT_S = 1.0
# The time of waiting for the lock of turntable.json, in seconds, after which a message says so.
_NOTICE_DELAY_S = 2.0
# The time between two attempts to take the lock of turntable.json, in seconds.
_POLL_INTERVAL_S = 0.02

# The keys of an entry of turntable.json that the terminal's table shows, by the titles of their columns.
_COLUMNS = {
    **{name: name for name in ("volume", "status", "kind", "frames", "primitives", "seconds")},
    "file PSNR": "file_psnr",
    "frames PSNR": "psnr",
    # Faults that were seen in pictures. The column is left out where no film has faults.
    "seen": "seen",
    "film": "film",
}
# The keys whose columns in the terminal's table are aligned to the right.
_NUMBER_COLUMNS = ("frames", "primitives", "seconds", "file_psnr", "psnr")
# The keys of an entry of turntable.json whose numbers are shown with one decimal.
DECIMAL_KEYS = ("psnr", "file_psnr", "seconds")

# The longest time of a film that an entry of turntable.json may have, in seconds: thirty years.
_MAX_SECONDS = 1e9
# The largest size of turntable.json, in bytes; an entry has about 500.
_MAX_BYTES = 2**26

_SECONDS = types.number(f"a number from 0 to {_MAX_SECONDS:g}", (int, float), 0, _MAX_SECONDS)
_EXIT_CODE = types.number("an exit code", (int,), -255, 255)
_NAME = schema.text_field("a name without a folder", "not a name", lambda name: os.path.basename(name) == name)


@dataclass(frozen=True)
class FilmEntry:
    """An entry of turntable.json: a volume, and the result of making its film. Paths are relative to the folder.

    made_by: the digest of a finished film's fingerprint, by which the next command sees that the film is up to date.
    psnr, psnr_interval: the PSNR of the drawn frames, in decibels, with its interval. file_psnr: the PSNR of the film's
    file. kind: the kind of data, or the name of the look. reason: why the data counts as this kind. values: the values
    that the film shows. seen: faults of its pictures. hidden: values that are hardly visible. primitives: the mean
    number of primitives of a frame. seconds: the time of the whole job. command: the command line that makes this film
    alone. further: keys that other programs have added.
    """

    volume: str
    scene: Annotated[str, _NAME]
    film: str
    status: Status
    made_by: str | None = None
    psnr: Annotated[float | None, types.DECIBELS] = None
    psnr_interval: Annotated[tuple[float, float] | None, types.INTERVAL] = None
    file_psnr: Annotated[float | None, types.DECIBELS] = None
    kind: str | None = None
    reason: str | None = None
    values: str | None = None
    seen: str | None = None
    hidden: str | None = None
    notes: tuple[str, ...] | None = None
    frames: Annotated[int | None, types.COUNT] = None
    primitives: Annotated[int | None, types.COUNT] = None
    seconds: Annotated[float | None, _SECONDS] = None
    exit_code: Annotated[int | None, _EXIT_CODE] = None
    error: str | None = None
    command: str | None = None
    further: Mapping[str, Any] = field(default_factory=dict)


FILM_ENTRY = types.open_record(FilmEntry)


def _parse_films(node: schema.TreeNode) -> Any:
    if not isinstance(node.value, list):
        return node.reject("not a list")
    return tuple(types.read_record(FILM_ENTRY, each) for each in node.value)


_FILMS: schema.FieldType[tuple[FilmEntry | None, ...]] = schema.FieldType("a list of films", _parse_films)


@dataclass(frozen=True)
class _Manifest:
    """The content of turntable.json. films: None in place of an entry that is damaged, or of another version."""

    films: Annotated[tuple[FilmEntry | None, ...], _FILMS] = ()
    further: Mapping[str, Any] = field(default_factory=dict)

    @property
    def by_scene(self) -> dict[str, FilmEntry]:
        """Return the undamaged entries by the names of their scenes."""
        return {each.scene: each for each in self.films if each is not None}


MANIFEST = RecordFile(types.open_record(_Manifest), MANIFEST_FILE, _MAX_BYTES)


def update_manifest(
    folder: Path, entries: Sequence[FilmEntry], reporter: Reporter, lock_timeout_s: float = LOCK_TIMEOUT_S
) -> None:
    """Write entries of films to turntable.json, in place of the earlier entries of their scenes.

    The entry of another film stays while the film's scene exists, or, if the film failed, while its volume exists.
    An entry of a film that was not started, or was interrupted before its start, changes nothing.

    lock_timeout_s: the longest time to wait for other processes, on any machine. Raises InputError and RenderError.
    """
    with locked_manifest(folder, reporter, lock_timeout_s):
        stored = _read(folder)
        films = stored.by_scene
        begun = {name for name, film in films.items() if film.status == STARTED}
        changed = {
            each.scene: each
            for each in entries
            if each.status != NOT_STARTED and (each.status != INTERRUPTED or each.scene in begun)
        }
        if not changed:
            return
        if num_left_out := stored.films.count(None):
            left_out = f"{counted(num_left_out, 'record')} left out: damaged, or of another version of hsplat"
            reporter.warning(f"{folder / MANIFEST_FILE}: {left_out}")
        kept = {name: film for name, film in films.items() if name in changed or _is_current(folder, film)}
        # In the order of their names, since films that are made at the same time are finished in any order.
        updated = replace(stored, films=tuple(film for _, film in sorted((kept | changed).items())))
        MANIFEST.write(folder / MANIFEST_FILE, updated)


def try_to_update(folder: Path, entries: Sequence[FilmEntry], reporter: Reporter) -> None:
    """Write entries to turntable.json after another error: wait for the lock only for a moment, and raise nothing."""
    with contextlib.suppress(HsplatError):
        update_manifest(folder, entries, reporter, _SHORT_LOCK_TIMEOUT_S)


@contextlib.contextmanager
def locked_manifest(folder: Path, reporter: Reporter, timeout_s: float) -> Iterator[None]:
    """Make a folder if it is missing, and lock its turntable.json; a wait for the lock is reported after a moment."""
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


def require_own_folder(folder: Path) -> None:
    """Raise InputError if a folder has files, hidden ones apart, and no turntable.json: hsplat has not made it."""
    with translate_os_errors(folder):
        names = sorted(name for name in os.listdir(folder) if name[0] != ".") if folder.is_dir() else []
    if names and MANIFEST_FILE not in names:
        raise InputError(
            "this folder has files, and hsplat has not made films in it",
            where=str(folder),
            got=join_some(names),
            expected=f"a new folder, an empty one, or one with {MANIFEST_FILE}",
            hint=f"`-o {folder}` writes into it all the same, `-o FOLDER` into another one",
        )


def read_films(folder: Path) -> dict[str, FilmEntry]:
    """Return the undamaged entries of turntable.json by the names of their scenes; none if it cannot be read."""
    return _read(folder).by_scene


def _read(folder: Path) -> _Manifest:
    with contextlib.suppress(InputError):
        return MANIFEST.find(folder / MANIFEST_FILE) or _Manifest()
    return _Manifest()


def _is_current(folder: Path, film: FilmEntry) -> bool:
    """Return whether the scene of an entry still exists, or its volume where no film could be made."""
    if os.path.exists(folder / film.scene):  # no error for impossible names
        return True
    return film.status == FAILED and has_volume(folder, film)


def has_volume(folder: Path, film: FilmEntry) -> bool:
    """Return whether the volume of an entry still exists; a volume at a URL counts as one that does."""
    return is_url(film.volume) or os.path.exists(found_path(film.volume, folder))


def manifest_table(folder: Path, films: Sequence[FilmEntry]) -> str:
    """Return a table with a line for each volume; the last column has the film, or the first line of its error."""
    has_seen = any(film.seen for film in films)
    columns = {title: key for title, key in _COLUMNS.items() if has_seen or key != "seen"}
    rows = [_row(folder, film, columns.values()) for film in films]
    numbers = [number for number, key in enumerate(columns.values()) if key in _NUMBER_COLUMNS]
    return format_table([list(columns), *rows], right_aligned=numbers)


def _row(folder: Path, film: FilmEntry, keys: Iterable[str]) -> list[str]:
    shown = record_to_json(film) | {key: decimal_text(getattr(film, key)) or "-" for key in DECIMAL_KEYS}
    volume = film.volume if is_url(film.volume) else os.path.normpath(folder / film.volume)
    shown |= {"volume": volume, "film": os.path.normpath(folder / film.film)}
    if film.status != FINISHED:
        shown["film"] = (film.error or "-").splitlines()[0]
    return [str(shown.get(key, "-")) for key in keys]


def decimal_text(value: float | None) -> str:
    """Return a number as text with one decimal; None as an empty text."""
    return "" if value is None else f"{value:.1f}"
