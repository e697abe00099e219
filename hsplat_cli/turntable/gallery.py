"""Write index.html over all films of turntable.json, with posters in sheets, and contact.png.

The page refers to films and sheets of its folder alone. What turntable.json says is text from anywhere: it is shown as
text, and a film that cannot be shown is told of and stops nothing.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable.manifest import FINISHED, LOCK_TIMEOUT_S, FilmEntry, locked_manifest, read_films
from renderer.errors import HsplatError, InputError
from renderer.film import frame_path, translate_os_errors, write_staged
from renderer.scene import FORMATS, output_suffix, require_file
from renderer.system import join_lines

if TYPE_CHECKING:
    from PIL.Image import Image

PAGE_FILE, CONTACT_FILE = "index.html", "contact.png"
# In each page, which is replaced; another one of this name stays.
_MARK = b"/* by hsplat turntable */"
# Writing the page while a batch runs takes at most this part of the time.
_SHARE = 0.05
# The keys of records whose texts and numbers are shown.
_TEXTS, _NUMBERS = ("status", "kind", "values", "hidden", "error", "command"), ("psnr", "file_psnr", "seconds")


class Gallery:
    """A gallery of the films of a folder, which grows while they are made. Failures to write it are warnings."""

    def __init__(self, folder: Path, reporter: Reporter) -> None:
        self._folder, self._reporter = folder, reporter
        self._next_s = 0.0
        self._problems: dict[str, str] = {}  # of films without posters, by their keys

    def grow(self) -> None:
        """Write the page, unless that was done a moment ago."""
        start = time.perf_counter()
        if start >= self._next_s:
            self._try_to_write(is_last=False)
            end = time.perf_counter()
            self._next_s = end + (end - start) / _SHARE

    def finish(self) -> None:
        """Write the page with all posters, and contact.png."""
        self._try_to_write(is_last=True)

    def _try_to_write(self, *, is_last: bool) -> None:
        try:
            while read_films(self._folder) and self._write(is_last=is_last) and is_last:
                pass
        except HsplatError as error:
            self._reporter.warning(join_lines(["the gallery is not written", *str(error).splitlines()]))

    def _write(self, *, is_last: bool) -> bool:
        """Write sheets and page, at last contact.png; return whether films are left whose posters are to be made."""
        # Imported here to keep --help fast.
        from hsplat_cli.reports import render_page
        from hsplat_cli.turntable.posters import NUM_SLOTS, PER_SIDE, contact_sheet, place_posters, sheet_name

        page = self._folder / PAGE_FILE
        _require_own_page(page)
        posters, is_more = self._new_posters()
        with locked_manifest(self._folder, self._reporter, LOCK_TIMEOUT_S):
            films = list(read_films(self._folder).values())
            keys = self._keys(films)
            slots = place_posters(self._folder, set(filter(None, keys)), posters)
            shown = [self._shown(record, key, slots) for record, key in zip(films, keys, strict=True)]
            num_sheets = max(slots.values(), default=-1) // NUM_SLOTS + 1
            text = render_page(
                "gallery.html",
                title=f"Films in {self._folder.resolve().name}",
                films=shown,
                num_made=sum(record["status"] == FINISHED for record in films),
                sheets=[sheet_name(number) for number in range(num_sheets)],
                per_side=PER_SIDE,
            )
            write_staged(page, text.encode(errors="backslashreplace"), is_durable=False)
            if is_last and not is_more and slots:
                names = {film["slot"]: film["name"] for film in shown if film["slot"] is not None}
                write_staged(self._folder / CONTACT_FILE, contact_sheet(self._folder, names), is_durable=False)
        return is_more

    def _new_posters(self) -> tuple[dict[str, Image], bool]:
        """Make posters of films that have none, as many as fill a sheet; return whether others are left.

        Others wait for the lock only while files are written.
        """
        from hsplat_cli.turntable.posters import NUM_SLOTS, make_poster, read_slots

        posters: dict[str, Image] = {}
        known = {None, *read_slots(self._folder), *self._problems}
        films = list(read_films(self._folder).values())
        missing = [(key, film) for key, film in zip(self._keys(films), films, strict=True) if key not in known]
        for key, film in missing[:NUM_SLOTS]:
            assert key is not None
            try:
                posters[key] = make_poster(self._folder / _film_path(film))
            except HsplatError as error:
                self._problems[key] = f"no picture: {error.summary}"
        return posters, len(missing) > NUM_SLOTS

    def _keys(self, films: Sequence[FilmEntry]) -> list[str | None]:
        """Return the keys of the posters of films; None where there is no film."""
        from hsplat_cli.turntable.posters import poster_key

        is_film = [record["status"] == FINISHED and _is_in_folder(_film_path(record)) for record in films]
        return [
            poster_key(self._folder, _film_path(record)) if shows else None
            for record, shows in zip(films, is_film, strict=True)
        ]

    def _shown(self, record: FilmEntry, key: str | None, slots: Mapping[str, int]) -> dict[str, Any]:
        """Return what the page shows of a film: texts and numbers, a link, the slot of its poster."""
        texts = {name: value if isinstance(value := record.get(name), str) else "" for name in _TEXTS}
        numbers = {
            name: f"{value:.1f}" if isinstance(value := record.get(name), (int, float)) else "" for name in _NUMBERS
        }
        notes = record.get("notes")
        is_missing = key is None and record["status"] == FINISHED
        problem = "the film is missing" if is_missing else self._problems.get(key or "", "")
        return {
            **texts,
            **numbers,
            "name": Path(record["scene"]).stem,
            "link": key and quote(os.fsencode(frame_path(_film_path(record), 0))),
            "slot": slots.get(key or ""),
            "notes": [each for each in (problem, *(notes if isinstance(notes, list) else ())) if each],
        }


def _film_path(record: FilmEntry) -> Path:
    """Return the path of a film relative to its folder, as far as it lies there."""
    film, folder = Path(record["film"]), Path(record["scene"]).parent
    return film.relative_to(folder) if film.is_relative_to(folder) else film


def _is_in_folder(film: Path) -> bool:
    return not film.is_absolute() and ".." not in film.parts and output_suffix(film) in FORMATS


def _require_own_page(page: Path) -> None:
    """Raise InputError for a page of somebody else."""
    require_file(page, "a page of this command")
    with translate_os_errors(page):
        is_own = not page.exists() or _MARK in page.read_bytes()
    if not is_own:
        raise InputError("another page has this name", where=str(page), hint="move it, or give another --output")
