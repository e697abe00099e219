"""Write the files of a study's report, each whole or not at all."""

from __future__ import annotations

from pathlib import Path

from hsplat_cli.reports.html import require_page_packages
from hsplat_cli.reports.study_html import study_page
from hsplat_cli.reports.tables import csv_text, json_text
from renderer.film import write_staged
from renderer.study import Study

# The page comes last: if it exists, the others do.
REPORT_FILES = ("measure.csv", "measure.json", "index.html")


def write_study(study: Study, folder: Path, *, date: str) -> list[Path]:
    """Write measure.csv, measure.json and index.html into `folder`, and return their paths.

    date: shown in the report. Equal studies and dates give equal bytes. Missing folders are created. All files are made
    before the first is written. Raises InputError if a package for pages is missing or a name cannot be a file, and
    RenderError if the system refuses.
    """
    require_page_packages()
    texts = (csv_text(study), json_text(study, date=date), study_page(study, date=date))
    paths = [folder / name for name in REPORT_FILES]
    # File names that are not UTF-8 have surrogates in Python, which become escapes in JSON.
    contents = [text.encode(errors="backslashreplace") for text in texts]
    for path, content in zip(paths, contents, strict=True):
        write_staged(path, content)
    return paths
