"""The files that a command reads: none of its outputs takes the place of one of them."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from hsplat_cli.scenes.volume_names import data_files
from renderer.errors import InputError
from renderer.scene import FileSource, ProceduralSource, VolumeSpec

_TIFF = (".tif", ".tiff")
# How pictures, films and sidecars begin, which may lie among the slices of a volume; that of MP4 is behind a length.
_OUTPUTS, _MP4 = (b"\x89PNG", b"GIF8", b"{"), b"ftyp"


def require_no_input(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Raise InputError where an output is there and is the same file as one of the inputs, by whatever links.

    inputs: not looked at where no output is there.
    """
    there: dict[tuple[int, int] | None, Path] = {mark: path for path in outputs if (mark := _mark(path)) is not None}
    if not there:
        return
    for path in inputs:
        output = there.get(_mark(path))
        if output is not None:
            raise InputError(
                "this output is an input, too, and would take its place",
                where=str(output),
                got=f"the input {path}",
                expected="a file that is not read",
                hint="give the output another name or folder",
            )


def files_of(volume: VolumeSpec) -> Iterator[Path]:
    """The files of a volume, as far as they can be told: the data files of a header and the slices of a folder, too."""
    source = volume.source
    if isinstance(source, ProceduralSource):
        return
    yield source.file
    with contextlib.suppress(OSError):  # said by its reader
        if source.file.is_dir():
            entries = list(source.file.iterdir())
            tiffs = [entry for entry in entries if entry.suffix.lower() in _TIFF]
            yield from tiffs or filter(_may_be_dicom, entries)
        elif isinstance(source, FileSource):
            yield from data_files(source.file)


def _mark(path: Path) -> tuple[int, int] | None:
    """What a file has in common with all links to it; None where there is none."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return None
    return status.st_dev, status.st_ino


def _may_be_dicom(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            start = file.read(132)
    except OSError:
        return True
    return start[128:] == b"DICM" or not (start.startswith(_OUTPUTS) or start[4:8] == _MP4)
