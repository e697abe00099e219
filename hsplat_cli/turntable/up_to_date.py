"""Find films that are up to date by times and sizes of files alone, without a process for each.

The record of a film has `made_by`, a digest of what it was made with: versions, the request, its files and those that
it was made from. Where anything differs, its process decides, which reads the voxels.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from hsplat_cli.turntable.manifest import FINISHED, FilmEntry
from renderer.film import data_digest
from renderer.system import package_versions, sources_digest

if TYPE_CHECKING:
    from hsplat_cli.turntable.one_film import FilmRequest

_Marks = list[tuple[object, ...]]


def marks_of(files: Iterable[Path]) -> _Marks:
    """Return what changes with the content of files: sizes and times, of which nobody can set the last one."""
    return [(str(file), *_mark(file)) for file in files]


def _mark(file: Path) -> tuple[int, ...]:
    try:
        found = file.stat()
    except (OSError, ValueError):
        return ()
    return found.st_size, found.st_mtime_ns, found.st_ctime_ns


def made_by(request: FilmRequest, inputs: _Marks) -> str:
    """Return the digest of a film that is finished. inputs: marks of its input files, from before they were read."""
    return data_digest([request.wish, _program(), inputs, marks_of(request.film_files.all_files())])


@functools.cache
def _program() -> list[object]:
    return [package_versions(), sources_digest(), sources_digest("hsplat_cli")]


def up_to_date_record(request: FilmRequest, films: Mapping[str, FilmEntry]) -> FilmEntry | None:
    """Return the record of a film that is known to be up to date. films: as `read_films` returns them."""
    record = films.get(request.scene.name, {})
    if request.force or "made_by" not in record:
        return None
    is_same = record["made_by"] == made_by(request, marks_of(request.input_files()))
    return record | request.record(FINISHED) if is_same else None
