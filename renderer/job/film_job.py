"""Describe a film to make, and the film that it is made again from, if any."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from renderer.film import WrittenFiles, film_files, require_no_input, sidecar_path
from renderer.job.inputs import require_no_new_slices, scene_files
from renderer.scene import ErrorSpec, FilmScene, is_same_file

if TYPE_CHECKING:  # records take a while to load, and the job of a scene needs none before it draws
    from renderer.job.record import FilmRecord


@dataclass(frozen=True)
class OriginalFilm:
    """A film that is made again, perhaps with changes.

    path: of its sidecar. keeps_accuracy: whether what was measured of it holds for the new film, too.
    keeps_versions: whether the same bytes are expected, so that other versions are told.
    """

    path: Path
    record: FilmRecord
    keeps_accuracy: bool = True
    keeps_versions: bool = True

    @property
    def frames_digest(self) -> str | None:
        """Return the digest of what its frames depended on; None for a film that one pass would not have made."""
        return None if self.record.fingerprint is None else self.record.fingerprint.frames_digest

    @property
    def tools(self) -> dict[str, Any]:
        """Return the versions of what made it by name, with `device` and `sources`; none where they do not count."""
        if not self.keeps_versions:
            return {}
        found = {**self.record.versions, "device": self.record.device}
        sources = self.record.fingerprint and self.record.fingerprint.depends_on.get("sources")
        return found | ({"sources": sources} if isinstance(sources, str) else {})


@dataclass(frozen=True)
class FilmJob:
    """A film to make: a scene, and what to draw of it.

    frames: their numbers, ascending. requested: the accuracy, as the section `error` of a scene.
    original: the film that is made again, if any. path: the scene file or the sidecar that was read, if any.
    """

    scene: FilmScene
    frames: Sequence[int]
    requested: ErrorSpec
    original: OriginalFilm | None = None
    path: Path | None = None

    @property
    def sidecar(self) -> Path:
        """Return the JSON file beside the output."""
        return sidecar_path(self.scene, self.frames)

    def input_files(self) -> Iterator[Path]:
        """Yield the files that the job reads: its own, and those that the scene names."""
        if self.path is not None:
            yield self.path
        yield from scene_files(self.scene)

    @property
    def written_files(self) -> WrittenFiles:
        """Return the files that the job may write, replace or remove."""
        return film_files(self.scene.output, self.frames, self.sidecar)

    def require_harmless(self) -> None:
        """Raise InputError where a file that the job writes would harm another one, as `WrittenFiles` says.

        The sidecar that a film is made again from may be rewritten.
        """
        written = self.written_files
        if self.original is not None and is_same_file(self.original.path, self.sidecar):
            require_no_input([self.sidecar], scene_files(self.scene))
            written = replace(written, files=[file for file in written.files if file != self.sidecar])
        written.require_harmless(self.input_files())
        require_no_new_slices(self.scene.output.files, self.scene)
