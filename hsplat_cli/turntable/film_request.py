"""Defines a request for a film of one volume: its files, its entry in turntable.json, and its fingerprint."""

from __future__ import annotations

import functools
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.scenes import SCHEMA_FILE, SharedLook, volume_place
from hsplat_cli.turntable.gallery import CONTACT_FILE, PAGE_FILE, poster_file
from hsplat_cli.turntable.manifest import FAILED, LOCK_FILE, MANIFEST_FILE, NOT_STARTED, FilmEntry, Status
from renderer.errors import HsplatError, InputError, OutputLockedError
from renderer.film import WrittenFiles, film_files, sidecar_path_of_file
from renderer.job import scene_files, volume_files
from renderer.record import FileStates, Fingerprint, file_states, program_versions
from renderer.scene import OutputSpec, VolumeSpec, file_source, relative_path
from renderer.suggest import FilmOptions
from renderer.system import sources_digest

# The names of files in a folder of films that belong to no single film.
_FOLDER_FILES = (MANIFEST_FILE, LOCK_FILE, PAGE_FILE, CONTACT_FILE, SCHEMA_FILE)


@dataclass(frozen=True)
class FilmRequest:
    """A request for a film of one volume.

    film: the options by which a scene is suggested. scene: the path of the film's scene file. output: the path of the
    film. look: the look of another scene; None to suggest one. force: an edited scene may be overwritten, and finished
    frames are drawn again. command: the command line that makes this film alone. problem: an error that is known before
    the volume is read, and that prevents the film. num_processes: the number of processes of this machine that make
    films at once.
    """

    volume: VolumeSpec
    film: FilmOptions
    scene: Path
    output: Path
    executor: ExecutorSpec
    force: bool
    command: str = ""
    look: SharedLook | None = None
    problem: InputError | None = None
    num_processes: int = 1

    @property
    def outputs(self) -> OutputSpec:
        """Return the outputs of the film: one file, or as many as the look's scene has."""
        return self.look.outputs(self.scene.parent, self.scene.stem) if self.look else OutputSpec(self.output)

    def entry(self, status: Status) -> FilmEntry:
        """Return the film's entry of turntable.json, with nothing but its files and its status."""
        folder = self.scene.parent
        volume = relative_path(volume_place(self.volume), folder)
        return FilmEntry(volume, self.scene.name, relative_path(self.output, folder), status)

    def failure(self, error: HsplatError) -> FilmEntry:
        """Return the entry of a film that failed, or that another job is making. Exit code 2 is for wrong input."""
        return replace(
            self.entry(NOT_STARTED if isinstance(error, OutputLockedError) else FAILED),
            exit_code=2 if isinstance(error, InputError) else 1,
            error=str(error),
            command=self.command,
        )

    @property
    def volume_path(self) -> str:
        """Return the path of the volume, relative to the folder and without links, or its URL."""
        place = volume_place(self.volume)
        if isinstance(place, str):
            return place
        return os.path.relpath(os.path.realpath(place), os.path.realpath(self.scene.parent))

    def input_files(self) -> Iterator[Path]:
        """Yield all files that the film is made from."""
        for volume in filter(None, (self.volume, self.film.under)):
            yield from volume_files(volume)
            file = volume_place(volume)
            if isinstance(file, Path) and ".ome." in file.name:  # an OME file may name other files beside it
                yield from sorted(file.parent.glob("*.ome.*"))
        if self.film.preset is not None:
            yield Path(self.film.preset.partition("#")[0])
        yield from _look_files(self.look)

    @property
    def film_files(self) -> WrittenFiles:
        """Return the files that are written for the film: its scene, outputs, sidecar and unfinished work."""
        frames = range(self.look.scene.num_frames if self.look else self.film.frames)
        sidecar = sidecar_path_of_file(self.output, frames, len(frames))
        return WrittenFiles([self.scene]) + film_files(self.outputs, frames, sidecar)

    def fingerprint(self, inputs: FileStates) -> Fingerprint:
        """Return the fingerprint of the finished film, with the sizes and times of files in place of their content.

        inputs: the states of the film's input files, taken before the files were read.
        """
        request = repr(replace(self, force=False, command="", num_processes=1))
        made = file_states(self.film_files.all_files())
        return Fingerprint.of(request=request, program=_program(), inputs=inputs, made=made)


@functools.cache
def _program() -> dict[str, Any]:
    return {**program_versions(), "sources of the client": sources_digest("hsplat_cli")}


def require_harmless(requests: Sequence[FilmRequest]) -> None:
    """Raise InputError if an output of one of the films is a file of a volume or a look, or another output."""
    folder = requests[0].scene.parent
    posters = [poster_file(folder, request.scene.stem) for request in requests]
    written = WrittenFiles([*(folder / name for name in _FOLDER_FILES), *posters])
    for request in requests:
        written += request.film_files
    volumes = {each for request in requests for each in (request.volume, request.film.under) if each is not None}
    written.require_harmless(chain(_look_files(requests[0].look), *map(volume_files, volumes)))


def _look_files(look: SharedLook | None) -> Iterator[Path]:
    if look is not None:
        yield from (look.path, *scene_files(look.scene))
        yield from volume_files(VolumeSpec(file_source(look.reference))) if look.reference is not None else ()
