"""Describe a film to make: its scene, its frames, and the accuracy that is requested."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from renderer.film import WrittenFiles, film_files, require_no_input, sidecar_path
from renderer.job.inputs import require_no_new_slices, scene_files
from renderer.scene import ErrorSpec, FilmScene, is_same_file

if TYPE_CHECKING:  # records take a while to load, and the job of a scene needs no record before it draws
    from renderer.record import FinishedFilm


# The results that a film which is made again must have in common with the original film: the frames and their measured
# accuracy (film), the frames alone (frames), or no results, since the scene was changed (nothing).
Repeats = Literal["film", "frames", "nothing"]


@dataclass(frozen=True)
class FilmJob:
    """A film to make: a scene, and the frames of it that are drawn.

    frames: the numbers of the frames, ascending.
    requested: the accuracy that is requested, as the section `error` of a scene.
    original: the film that is made again, if any.
    path: the scene file or the sidecar that was read, if any.
    repeats: the results of the original that are expected again.
    """

    scene: FilmScene
    frames: Sequence[int]
    requested: ErrorSpec
    original: FinishedFilm | None = None
    path: Path | None = None
    repeats: Repeats = "film"

    @property
    def sidecar(self) -> Path:
        """Return the path of the sidecar, the JSON file beside the output that records the film."""
        return sidecar_path(self.scene, self.frames)

    def input_files(self) -> Iterator[Path]:
        """Yield the files that the job reads: the scene file, and the files that the scene names."""
        if self.path is not None:
            yield self.path
        yield from scene_files(self.scene)

    @property
    def written_files(self) -> WrittenFiles:
        """Return the files that the job may write, replace or remove."""
        return film_files(self.scene.output, self.frames, self.sidecar)

    def require_harmless(self) -> None:
        """Raise InputError if a file that the job writes would harm another file, by the rules of `WrittenFiles`.

        If a film is made again from its own sidecar, this sidecar may be replaced.
        """
        written = self.written_files
        if self.original is not None and is_same_file(self.original.path, self.sidecar):
            require_no_input([self.sidecar], scene_files(self.scene))
            written = replace(written, files=[file for file in written.files if file != self.sidecar])
        written.require_harmless(self.input_files())
        require_no_new_slices(self.scene.output.files, self.scene)
