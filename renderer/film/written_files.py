"""List the files that a job writes, and refuse files that would harm an input, unfinished work or each other.

Every command that writes files lists them here before it draws anything. Paths are compared after following all links,
also where folders do not exist yet.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain
from pathlib import Path
from typing import NoReturn

from renderer.errors import InputError
from renderer.film.names import UNFINISHED_SUFFIX, picture_files, unfinished_folder
from renderer.scene import OutputSpec, place_name, place_of

# The hint of every error that refuses an output.
_HINT = "give the output another name or folder"


@dataclass(frozen=True)
class WrittenFiles:
    """A list of all files that a job may write, replace or remove.

    files: the files, by their final names. folders: the folders for unfinished work, where any file may be removed.
    """

    files: Sequence[Path]
    folders: Sequence[Path] = ()

    def __add__(self, other: WrittenFiles) -> WrittenFiles:
        """Return a list of all files and folders of two lists."""
        return WrittenFiles((*self.files, *other.files), (*self.folders, *other.folders))

    def all_files(self) -> Iterator[Path]:
        """Yield the files of the list, and all files that are now in its folders for unfinished work."""
        yield from self.files
        for folder in self.folders:
            yield from folder_files(folder)

    def require_harmless(self, inputs: Iterable[Path]) -> None:
        """Raise InputError if a file is an input, another file of the list, or in a folder for unfinished work.

        inputs: the input files, which are only iterated if a file of the list exists.
        """
        _require_different_places(self.files)
        require_no_input(self.all_files(), inputs)


def film_files(output: OutputSpec, frames: Sequence[int], sidecar: Path) -> WrittenFiles:
    """Return the list of files that a job writes to draw these frames: pictures, sidecar, and unfinished work."""
    pictures = chain.from_iterable(picture_files(each, frames) for each in output.files)
    folders = dict.fromkeys(unfinished_folder(each) for each in output.files)
    return WrittenFiles((*pictures, sidecar), (*folders,))


def folder_files(folder: Path) -> Iterator[Path]:
    """Yield the entries of a folder; none if it is missing or cannot be read."""
    with contextlib.suppress(OSError):
        yield from folder.iterdir()


def require_no_input(outputs: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Raise InputError if an existing output is the same file as one of the inputs, through any links.

    inputs: the input files, which are only iterated if an output exists.
    """
    there: dict[tuple[int, int] | None, Path] = {mark: path for path in outputs if (mark := _mark(path)) is not None}
    if not there:
        return
    for path in inputs:
        output = there.get(_mark(path))
        if output is not None:
            _refuse("this output would overwrite an input", output, f"the input {path}", "a file that is not read")


def _require_different_places(files: Iterable[Path]) -> None:
    """Raise InputError if two paths are one file, if a file is the folder of another one, or if a file lies in a folder
    for unfinished work.
    """
    place_of_folder = cache(place_of)  # thousands of frames share a folder
    known, folders = dict[str, Path](), dict[str, Path]()
    for file in files:
        folder, name = os.path.split(file)
        place = place_of(file) if os.path.islink(file) else os.path.join(place_of_folder(folder), place_name(name))
        if place in known:
            _refuse("two outputs are one file", file, f"the output {known[place]}", "a file of its own")
        known[place] = file
        folders.setdefault(os.path.dirname(place), file)
    for folder, file in [*folders.items()]:
        for each in map(str, (Path(folder), *Path(folder).parents)):
            if each.endswith(UNFINISHED_SUFFIX):
                _refuse("this output is in a folder for unfinished frames", file, each, "another folder")
            folders.setdefault(each, file)
    for folder in known.keys() & folders.keys():
        got = f"the output {folders[folder]}"
        _refuse("this output is the folder of another one", known[folder], got, "another name")


def _refuse(what: str, output: Path, got: str, expected: str) -> NoReturn:
    raise InputError(what, where=str(output), got=got, expected=expected, hint=_HINT)


def _mark(path: Path) -> tuple[int, int] | None:
    """Return the device and inode number of a file, which all links to it share; None if it does not exist.

    `missing/../film.mp4` counts as existing if `film.mp4` does, as the missing folders of outputs will be made.
    """
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        if ".." not in path.parts:
            return None
        return _mark(Path(os.path.realpath(path)))
    return status.st_dev, status.st_ino
