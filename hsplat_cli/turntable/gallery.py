"""Writes index.html, a page of all films of turntable.json with their posters, and contact.png.

The page refers only to files of its folder. turntable.json is untrusted: the page shows all its values as text. A film
that cannot be shown has a note, and does not stop the others.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from urllib.parse import quote

from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable.manifest import (
    DECIMAL_KEYS,
    FINISHED,
    LOCK_TIMEOUT_S,
    FilmEntry,
    decimal_text,
    locked_manifest,
    read_films,
)
from renderer.errors import HsplatError
from renderer.film import frame_path, write_staged
from renderer.scene import FORMATS, output_suffix
from renderer.system import join_lines

PAGE_FILE = "index.html"
CONTACT_FILE = "contact.png"
# Largest share of a batch's time that writing the page may take.
_SHARE = 0.05
# Largest number of missing posters that are made each time that a running batch writes the page.
_MAX_POSTERS = 100
# Keys of a film's entry in turntable.json whose values the page shows as text.
_TEXTS = ("status", "kind", "values", "hidden", "error", "command")


class Gallery:
    """Writes the page of the films of a folder while they are made. Failures to write it are warnings."""

    def __init__(self, folder: Path, reporter: Reporter) -> None:
        self._folder, self._reporter, self._next_s = folder, reporter, 0.0

    def grow(self) -> None:
        """Write the page, unless it was written a moment ago."""
        start = time.perf_counter()
        if start >= self._next_s:
            self._write(_MAX_POSTERS)
            self._next_s = time.perf_counter() + (time.perf_counter() - start) / _SHARE

    def finish(self) -> None:
        """Write the page with all posters, and contact.png, and name the page."""
        self._write(None)

    def _write(self, max_posters: int | None) -> None:
        """Write missing posters, at most `max_posters`, and the page; if `max_posters` is None, also contact.png."""
        # Imported here to keep --help fast.
        from hsplat_cli.reports import render_page, require_own_page
        from hsplat_cli.turntable.posters import contact_sheet

        folder = self._folder
        if not (films := read_films(folder)):
            return
        try:
            require_own_page(folder / PAGE_FILE)
            problems = _make_posters(folder, films.values(), max_posters)  # slow, so before the lock is taken
            with locked_manifest(folder, self._reporter, LOCK_TIMEOUT_S):
                shown = [_shown(folder, film, problems) for film in read_films(folder).values()]
                page = render_page("gallery.html", title=f"Films in {folder.resolve().name}", films=shown)
                write_staged(folder / PAGE_FILE, page.encode(errors="backslashreplace"), is_durable=False)
            names = [str(film["name"]) for film in shown if film["poster"]]
            posters = [(poster_file(folder, name), name) for name in names]
            if max_posters is None and posters:
                write_staged(folder / CONTACT_FILE, contact_sheet(posters), is_durable=False)
            if max_posters is None:
                self._reporter.line(f"page of all films: {folder / PAGE_FILE}")
        except HsplatError as error:
            self._reporter.warning(join_lines(["the gallery is not written", *str(error).splitlines()]))


def poster_file(folder: Path, name: str) -> Path:
    """Return the file of a film's poster. name: the name of the film's scene file, without suffix."""
    return folder / "posters" / f"{name}.jpg"


def _make_posters(folder: Path, films: Iterable[FilmEntry], limit: int | None) -> dict[str, str]:
    """Make up to `limit` missing posters; return the problem of each film without one, by the name of its scene."""
    from hsplat_cli.turntable.posters import is_poster_of, make_poster

    found = ((each.scene, _film_file(folder, each)) for each in films)
    files = [(scene, film, poster_file(folder, Path(scene).stem)) for scene, film in found if film is not None]
    problems = {}
    for scene, film, poster in [each for each in files if not is_poster_of(*each[1:])][:limit]:
        try:
            make_poster(film, poster)
        except HsplatError as error:
            problems[scene] = f"no picture: {error.summary}"
    return problems


def _film_file(folder: Path, entry: FilmEntry) -> Path | None:
    """Return the path of a film, or of its first frame; None if the film is not finished, or not in the folder."""
    film = frame_path(Path(entry.film), 0)
    is_inside = not film.is_absolute() and ".." not in film.parts
    is_film = entry.status == FINISHED and is_inside and output_suffix(film) in FORMATS
    return folder / film if is_film and os.path.isfile(folder / film) else None


def _shown(folder: Path, entry: FilmEntry, problems: Mapping[str, str]) -> dict[str, object]:
    """Return the values of a film for the page: texts and numbers, and references to the film and its poster."""
    from hsplat_cli.turntable.posters import is_poster_of

    name, film = Path(entry.scene).stem, _film_file(folder, entry)
    poster = poster_file(folder, name)
    has_poster = film is not None and is_poster_of(film, poster)
    problem = "there is no film" if film is None and entry.status == FINISHED else problems.get(entry.scene)
    return {
        "name": name,
        "film": film and quote(os.fsencode(film.relative_to(folder))),
        "poster": has_poster and quote(os.fsencode(poster.relative_to(folder))),
        "notes": [each for each in (problem, *(entry.notes or ())) if each],
        **{key: getattr(entry, key) or "" for key in _TEXTS},
        **{key: decimal_text(getattr(entry, key)) for key in DECIMAL_KEYS},
    }
