"""The files of a report: each is there whole or not at all, and a folder that cannot hold them is told early."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from hsplat_cli.reports.html import require_page_packages
from hsplat_cli.reports.study_html import study_page
from hsplat_cli.reports.tables import csv_text, json_text
from renderer.errors import InputError
from renderer.film import require_writable, write_staged
from renderer.study import Study

# The page comes last: where it is, the others are.
FILES = ("measure.csv", "measure.json", "index.html")


def require_writable_files(folder: Path, names: Sequence[str] = FILES) -> None:
    """Try whether files of these names, by default those of `write_study`, can be written into `folder`, and leave
    everything as it was.

    Raises InputError where the folder or one above it is a file, or an output is a folder; RenderError where the
    system refuses (no permission, no space).
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(
            "the folder of the report is a file",
            where=str(folder),
            got="a file",
            expected="a folder, or a name that is free",
            hint="name another folder",
        )
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        for name in names:
            require_writable(folder / name)
    finally:
        for path in made:
            with contextlib.suppress(OSError):  # it was not made, or another program has put something into it
                path.rmdir()


def write_study(study: Study, folder: Path, *, date: str) -> list[Path]:
    """Write measure.csv, measure.json and index.html into `folder`, which is made, and return their paths.

    date: as it shall stand in the report. The same study and date give the same bytes. Raises InputError where a
    package that makes the page is missing, and as `require_writable_files` does; nothing is written before all is made.
    """
    require_page_packages()
    texts = (csv_text(study), json_text(study, date=date), study_page(study, date=date))
    paths = [folder / name for name in FILES]
    for path, text in zip(paths, texts, strict=True):
        write_staged(path, text.encode())
    return paths
