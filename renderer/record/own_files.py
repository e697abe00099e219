"""Tell which files a film has made, so that it replaces no other file of the same name.

A file with the name of the first output is replaced even if it belongs to another film, and a note says so. Further
outputs and the sidecar are protected: a further output may belong to a film that is still wanted, and the name of the
sidecar is nobody's choice.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from renderer.errors import InputError
from renderer.film import film_sidecars, picture_files, unfinished_folder
from renderer.scene import MAX_SIDECAR_BYTES, OutputFile, OutputSpec, read_json_object, relative_path

if TYPE_CHECKING:  # records take a while to load; a film whose files do not exist yet needs none
    from renderer.record.film_record import FilmRecord


def require_own_files(output: OutputSpec, frames: Sequence[int], sidecar: Path) -> None:
    """Raise InputError if a further output exists that no job of this film has made, or if another JSON file has the
    name of the sidecar.

    A damaged sidecar is made again.
    """
    known = read_json_object(sidecar, MAX_SIDECAR_BYTES)
    if known and "scene" not in known:
        raise InputError(
            "something else has the name of the sidecar",
            where=str(sidecar),
            got="a JSON file of another program",
            expected="the JSON file of a film",
            hint="rename it, or choose another --output; --force replaces it",
        )
    if naming_mark(output, sidecar).exists():
        return
    for each in output.others:
        file = next(filter(os.path.lexists, picture_files(each, frames)), None)
        if file is not None and not any(_has_made(record, output, each) for record in _records(output, sidecar)):
            raise InputError(
                "this further output exists, and is not of this film",
                where=str(file),
                got=f"a file that {sidecar} does not describe",
                hint="give the output another name; --force replaces the file",
            )


def naming_mark(output: OutputSpec, sidecar: Path) -> Path:
    """Return the path of a file that exists while outputs get their final names, before the sidecar is written."""
    return unfinished_folder(output) / f"{sidecar.name}.naming"


def _records(output: OutputSpec, sidecar: Path) -> Iterator[FilmRecord]:
    """Yield the records in the sidecars of an output: first `sidecar`, then those of the whole film and its parts."""
    from renderer.record.sidecar import SIDECAR

    for path in dict.fromkeys([sidecar, *film_sidecars(output.file)]):
        with suppress(InputError):  # a damaged sidecar is reported when the job looks for a finished film
            record = SIDECAR.find(path)
            if record is not None:
                yield record


def _has_made(record: FilmRecord, output: OutputSpec, each: OutputFile) -> bool:
    """Return whether a record lists the further output `each`.

    Places are compared as seen from the folder of the first output, as the film may have been moved.
    """
    place = relative_path(each.file, output.file.parent)
    return any(made.frames and made.file == place for made in record.outputs)
