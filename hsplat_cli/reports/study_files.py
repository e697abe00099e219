"""Write the files of a study's report, each whole or not at all."""

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

# The page comes last: if it exists, the others do.
REPORT_FILES = ("measure.csv", "measure.json", "index.html")


def require_writable_files(folder: Path, names: Sequence[str] = REPORT_FILES) -> None:
    """Check that these files, by default those of `write_study`, can be written into `folder`; change nothing.

    Raises InputError if the folder or one above it is a file, or an output is a folder; RenderError if the system
    refuses (no permission, no space).
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(
            "the folder of the report is a file",
            where=str(folder),
            got="a file",
            expected="a folder, or an unused name",
            hint="name another folder",
        )
    missing_folders = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        for name in names:
            require_writable(folder / name)
    finally:
        for path in missing_folders:
            with contextlib.suppress(OSError):  # not created, or no longer empty
                path.rmdir()


def write_study(study: Study, folder: Path, *, date: str) -> list[Path]:
    """Write measure.csv, measure.json and index.html into `folder`, and return their paths.

    date: shown in the report. Equal studies and dates give equal bytes. Missing folders are created. All files are made
    before the first is written. Raises InputError if a package for pages is missing, and as `require_writable_files`.
    """
    require_page_packages()
    texts = (csv_text(study), json_text(study, date=date), study_page(study, date=date))
    paths = [folder / name for name in REPORT_FILES]
    for path, text in zip(paths, texts, strict=True):
        write_staged(path, text.encode())
    return paths
