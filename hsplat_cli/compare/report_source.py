"""Read reports, from a folder or from a ZIP archive, which anybody may have edited.

An artifact of a CI job may hold several reports: one of each test, or of each machine.
Names of pictures must be those that a report gives, no link is followed, and sizes are checked before memory is taken.
"""

from __future__ import annotations

import contextlib
import os
import re
import stat
import struct
import zipfile
import zlib
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import islice, takewhile
from pathlib import Path, PurePosixPath
from typing import Protocol

from hsplat_cli.compare.outcome import REPORT, Comparison
from hsplat_cli.compare.picture_file import MAX_FILE_BYTES, file_content
from hsplat_cli.compare.report_folder import FILES, REPORT_FILE
from renderer.errors import InputError
from renderer.scene import first_few, may_be_json, require_file

# The names of pictures in a report.
_PICTURE = re.compile(r"films/[0-9]{1,6}/(?:old|new)/[^/\\]{1,200}\.png")
# The things that are reports, for messages.
_EXPECTED = f"the folder of a report, or a ZIP archive of it, with {REPORT_FILE}"
# The most entries of an archive: two pictures for each frame of a thousand films of a hundred frames. Python keeps
# about 600 bytes of each.
_MAX_ENTRIES = 200_000
# The ways of compression that are read. Others take as much memory as the archive says.
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
# The errors of Python's reader of archives; it raises some that are not documented for damaged ones.
_ERRORS = (
    zipfile.BadZipFile,
    NotImplementedError,
    RuntimeError,
    EOFError,
    OSError,
    ValueError,
    struct.error,
    zlib.error,
)


class ReportSource(Protocol):
    """A report that can be read. path: its place, for messages."""

    path: Path

    def names(self) -> list[str]:
        """Return the names of all entries in an archive; none in a folder, where people may keep other files."""

    def read(self, name: str, max_bytes: int) -> bytes:
        """Return the content of a file. Raises InputError if it is missing, no plain file, or too large."""


class _Folder:
    def __init__(self, path: Path) -> None:
        self.path = path

    def names(self) -> list[str]:
        return []

    def read(self, name: str, max_bytes: int) -> bytes:
        place = self.path / name
        steps = [place, *place.parents[: len(Path(name).parts) - 1]]
        if any(step.is_symlink() for step in steps):
            raise InputError("a link in a report", where=str(place), expected="a plain file")
        return file_content(place, max_bytes, f"{name} of a report")


class _Archive:
    """A report in an archive.

    all_names: the names of all entries, sorted. root: the report's folder there, with a slash at its end; empty at the
    top of the archive.
    """

    def __init__(self, path: Path, archive: zipfile.ZipFile, all_names: Sequence[str], root: str) -> None:
        self.path, self._archive, self._all_names, self._root = path / root, archive, all_names, root

    def names(self) -> list[str]:
        first = bisect_left(self._all_names, self._root)
        below = takewhile(lambda name: name.startswith(self._root), islice(self._all_names, first, None))
        return [name.removeprefix(self._root) for name in below if not name.endswith("/")]

    def read(self, name: str, max_bytes: int) -> bytes:
        try:
            entry = self._archive.getinfo(f"{self._root}{name}")
        except KeyError:
            raise InputError("a file is missing in this report", where=str(self.path), got=name) from None
        mode = entry.external_attr >> 16
        is_plain = entry.compress_type in _METHODS and stat.S_IFMT(mode) in (0, stat.S_IFREG)
        if entry.flag_bits & 1 or not is_plain:
            raise InputError("not a plain file in this report", where=str(self.path), got=name)
        if entry.file_size > max_bytes:
            what, expected = "too large a file in this report", f"at most {max_bytes} bytes"
            raise InputError(what, where=str(self.path), got=name, expected=expected)
        try:
            with self._archive.open(entry) as file:
                return file.read(entry.file_size)  # not more, whatever the data expand to
        except _ERRORS as error:
            raise InputError("a damaged file in this report", where=str(self.path), got=name) from error


@contextlib.contextmanager
def open_reports(path: Path) -> Iterator[Sequence[ReportSource]]:
    """Open all reports in a folder or in a ZIP archive, at least one. Raises InputError where there is none.

    path: the folder, the archive, or report.json in a folder. A folder with a report is that report alone.
    """
    if path.name == REPORT_FILE and path.is_file():
        path = path.parent
    if path.is_dir():
        folders = [path] if os.path.lexists(path / REPORT_FILE) else _folders(path)
        yield _checked([_Folder(folder) for folder in folders], path)
        return
    if not path.exists():
        raise InputError("no such report", where=str(path), expected=_EXPECTED)
    require_file(path, _EXPECTED)
    try:
        archive = zipfile.ZipFile(path)
    except _ERRORS as error:
        raise InputError("not a report", where=str(path), expected=_EXPECTED) from error
    with archive:
        names = sorted(archive.namelist())
        if len(names) > _MAX_ENTRIES:
            got, expected = f"an archive of {len(names)} files", f"at most {_MAX_ENTRIES}"
            raise InputError("not a report", where=str(path), got=got, expected=expected)
        if len(set(names)) < len(names):
            twice = next(name for name, count in Counter(names).items() if count > 1)
            raise InputError("not a report", where=str(path), got=f"an archive with two files {twice}")
        roots = sorted(name.removesuffix(REPORT_FILE) for name in names if PurePosixPath(name).name == REPORT_FILE)
        yield _checked([_Archive(path, archive, names, root) for root in roots], path)


def _folders(path: Path) -> list[Path]:
    """Return the folders with a report below a folder. Links are not followed."""
    return sorted(Path(folder) for folder, _, names in os.walk(path) if REPORT_FILE in names)


def _checked(reports: Sequence[ReportSource], path: Path) -> Sequence[ReportSource]:
    if not reports:
        raise InputError(
            f"no report in this {'folder' if path.is_dir() else 'archive'}",
            where=str(path),
            expected=f"{REPORT_FILE}, which `hsplat compare --report FOLDER` writes into its folder",
            hint="give that folder, or a ZIP archive of it, such as the artifact of a CI job",
        )
    return reports


def read_report(source: ReportSource) -> Comparison:
    """Return the outcomes in a report.

    Raises InputError, also for an archive with other files than the report names, and SceneError with all mistakes in
    report.json.
    """
    path = source.path / REPORT_FILE
    content = source.read(REPORT_FILE, REPORT.max_bytes)
    comparison = REPORT.from_json(REPORT.load(content, path) if may_be_json(content) else {}, path)
    frames = [frame for film in comparison.films for frame in film.frames]
    known = FILES.union(picture.file for frame in frames for picture in (frame.old, frame.new) if picture is not None)
    others = [name for name in source.names() if name not in known]
    if others:
        raise InputError(
            "files that the report does not name: somebody edited this archive",
            where=str(source.path),
            got=first_few(others),
            hint="take the archive as CI kept it, or unpack it and give the folder",
        )
    return comparison


def read_report_picture(source: ReportSource, name: str) -> bytes:
    """Return the content of the file of a picture in a report. Raises InputError for another name."""
    if not _PICTURE.fullmatch(name) or ".." in name:
        raise InputError("not a picture of a report", where=str(source.path), got=name)
    return source.read(name, MAX_FILE_BYTES)
