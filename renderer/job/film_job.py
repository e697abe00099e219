"""Describe a film to make."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from renderer.film import sidecar_path
from renderer.job.inputs import film_files, require_no_input, volume_files
from renderer.job.original import OriginalFilm
from renderer.scene import ErrorSpec, Scene, is_same_file


@dataclass(frozen=True)
class FilmJob:
    """A film to make: a scene, and what to draw of it.

    frames: their numbers, ascending. requested: the accuracy, as the section `error` of a scene.
    original: the film that is made again, if any. path: the scene file or the sidecar that was read, if any.
    """

    scene: Scene
    frames: Sequence[int]
    requested: ErrorSpec
    original: OriginalFilm | None = None
    path: Path | None = None

    @property
    def sidecar(self) -> Path:
        """Return the JSON file beside the output."""
        return sidecar_path(self.scene, self.frames)

    def input_files(self) -> Iterator[Path]:
        """Yield the files that the job reads: its own, and those of the volume."""
        if self.path is not None:
            yield self.path
        yield from volume_files(self.scene.volume)

    def require_no_input(self) -> None:
        """Raise InputError where an output is an input; the sidecar that a film is made again from may be rewritten."""
        outputs = film_files(self.scene.output, self.frames, self.sidecar)
        if self.original is not None and is_same_file(self.original.path, self.sidecar):
            require_no_input([self.sidecar], volume_files(self.scene.volume))
            outputs = (file for file in outputs if file != self.sidecar)
        require_no_input(outputs, self.input_files())
