"""Describe a film to make."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from renderer.film import sidecar_path
from renderer.job.inputs import volume_files
from renderer.job.original import OriginalFilm
from renderer.scene import ErrorSpec, Scene


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
