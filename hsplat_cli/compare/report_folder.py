"""Write a report: a folder with report.json, the page, pictures of films that fail, and files for CI.

    report/
      index.html           the page
      report.json          all outcomes, and what drew the new pictures
      junit.xml            the outcomes, as CI systems read them
      code-quality.json    the changed keys of scenes, as GitLab shows them
      summary.md           a table, as GitHub shows it
      films/0/old/frame-0007.png, films/0/new/frame-0007.png

It is made under a temporary name and renamed at the end. It replaces an earlier report, and nothing else.
"""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from hsplat_cli.compare.golden.record import picture_digest
from hsplat_cli.compare.outcome import REPORT, ComparedFilm, Comparison, ReportPicture
from renderer.errors import InputError
from renderer.film import Pixels, encode_png, folder_files, translate_os_errors
from renderer.scene import first_few, read_json_object

REPORT_FILE = "report.json"
PAGE_FILE = "index.html"
_PICTURES = "films"
# The names of the files of a report, beside its pictures.
FILES = frozenset({REPORT_FILE, PAGE_FILE, "junit.xml", "code-quality.json", "summary.md"})


@dataclass(frozen=True)
class PictureStore:
    """A place for the pictures of one film in a report.

    report: the folder of the report; None to keep no pictures. number: the index of the film.
    """

    report: Path | None
    number: int

    def add(
        self, side: str, name: str, picture: Pixels, psnr: float | None = None, content: bytes | None = None
    ) -> ReportPicture:
        """Keep a picture. side: `old` or `new`. content: of its PNG file, if it has one."""
        digest = picture_digest(picture)
        if self.report is None:
            return ReportPicture(digest, "", psnr)
        file = f"{_PICTURES}/{self.number}/{side}/{name}"
        path = self.report / file
        with translate_os_errors(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(encode_png(picture) if content is None else content)
        return ReportPicture(digest, file, psnr)

    def settled(self, film: ComparedFilm) -> ComparedFilm:
        """Return the film as the report has it: the pictures of one that does not fail are removed."""
        if film.verdict == "fails":
            return film
        if self.report is not None:
            folder = self.report / _PICTURES / str(self.number)
            shutil.rmtree(folder, ignore_errors=True)
            with contextlib.suppress(OSError):  # other films have pictures, or this one had none
                folder.parent.rmdir()
        frames = [replace(frame, old=_without_file(frame.old), new=_without_file(frame.new)) for frame in film.frames]
        return replace(film, frames=tuple(frames))


def _without_file(picture: ReportPicture | None) -> ReportPicture | None:
    return picture and replace(picture, file="")


def write_report(report: Path | None, comparison: Comparison) -> None:
    """Write all files of a report beside its pictures. report: the folder; None to make no report."""
    if report is None:
        return
    # Imported here: no report needs no templates.
    from hsplat_cli.compare.ci_files import code_quality, junit, summary_markdown
    from hsplat_cli.compare.page import report_page

    contents = {
        REPORT_FILE: REPORT.content(comparison),
        PAGE_FILE: report_page(comparison).encode(),
        "junit.xml": junit(comparison).encode(),
        "code-quality.json": code_quality(comparison).encode(),
        "summary.md": summary_markdown(comparison).encode(),
    }
    for name, content in contents.items():
        with translate_os_errors(report / name):
            (report / name).write_bytes(content)


@contextlib.contextmanager
def open_report(path: Path | None, inputs: Iterable[Path]) -> Iterator[Path | None]:
    """Open the folder of a report, which gets its name at the end of the block; None to make no report.

    An earlier report of this name is removed first.

    inputs: files and folders that are read. If the block raises, there is no report. Raises InputError if something
    else has the name, or if an input is in the earlier report.
    """
    if path is None:
        yield None
        return
    _require_replaceable(path, inputs)
    with translate_os_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(path, ignore_errors=True)
        making = path.parent / f".{path.name}-{secrets.token_hex(4)}"
        making.mkdir()
    try:
        yield making
        with translate_os_errors(path):
            making.rename(path)
    finally:
        shutil.rmtree(making, ignore_errors=True)


def _require_replaceable(path: Path, inputs: Iterable[Path]) -> None:
    """Raise InputError if a report would replace anything but an earlier report, or an empty folder, or an input."""
    if not os.path.lexists(path):
        return
    places = [Path.cwd(), *inputs]
    place = path.resolve()
    inside = next((each for each in places if place in (each.resolve(), *each.resolve().parents)), None)
    if path.is_symlink():
        got = "a link"
    elif not path.is_dir():
        got = "a file"
    elif inside is not None:
        got = f"a folder with {inside}, which is read"
    elif others := _other_files(path):
        got = f"a folder with other files: {first_few(others)}"
    else:
        return
    raise InputError("a report cannot replace this", where=f"--report {path}", got=got, expected="a new name")


def _other_files(path: Path) -> list[str]:
    """Return the names in a folder that no earlier report has; all names, if there is no report."""
    names = sorted(each.name for each in folder_files(path))
    data = read_json_object(path / REPORT_FILE, REPORT.max_bytes) or {}
    is_report = str(data.get("format")).startswith("hsplat comparison")
    return [name for name in names if not is_report or name not in FILES | {_PICTURES}]
