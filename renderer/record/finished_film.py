"""Look at a film that is made, by its sidecar: its files and frames, and whether it is the film that is requested."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from renderer.errors import InputError, SceneError
from renderer.film import film_path_of_sidecar, frame_path
from renderer.record.film_record import FilmFingerprint, FilmRecord
from renderer.record.sidecar import SIDECAR
from renderer.record.up_to_date import MadeFile, describe_differences
from renderer.scene import (
    CAMERA_FIELD,
    FRAME_FIELD,
    FilmScene,
    OutputFile,
    OutputSpec,
    first_output,
    schema,
    tolerance_at,
)


@dataclass(frozen=True)
class FinishedFilm:
    """A film as its sidecar describes it. Anybody may have edited the sidecar. path: the path of the sidecar."""

    path: Path
    record: FilmRecord

    @property
    def file(self) -> Path:
        """Return the path of the film, or of the template of its frames, in the folder where the sidecar is now."""
        return film_path_of_sidecar(self.path, Path(first_output(self.record.scene)["file"]))

    def frame_file(self, number: int) -> Path:
        """Return the path of the picture of a frame."""
        return frame_path(self.file, number)

    @property
    def num_path_frames(self) -> int:
        """Return the number of frames of the whole camera path. The film may show only some of them."""
        camera = schema.TreeNode(self.record.scene["camera"], "camera", [], film=schema.FilmTime(None, 1.0))
        return CAMERA_FIELD.read(camera).num_frames

    @property
    def has_goal(self) -> bool:
        """Return whether the film's tolerances were found for a goal, so that each frame may have another one."""
        return self.record.schedule.requested.goal is not None

    @property
    def frames_digest(self) -> str | None:
        """Return the digest of all that the film's frames depend on; None if no single job would draw them."""
        return None if self.record.fingerprint is None else self.record.fingerprint.frames_digest

    @property
    def tools(self) -> dict[str, Any]:
        """Return the versions of the packages that made the film, by name, with `device` and a digest as `sources`."""
        found = {**self.record.versions, "device": self.record.device}
        sources = self.record.fingerprint and self.record.fingerprint.depends_on.get("sources")
        return found | ({"sources": sources} if isinstance(sources, str) else {})

    def has_tolerances_of(self, scene: FilmScene) -> bool:
        """Return whether the film's frames were drawn at the tolerances of this scene.

        If `scene` is the recorded scene, this shows that nobody has changed the tolerances.
        """
        return scene.error.goal is None and all(
            tolerance_at(scene.error, frame.frame) == frame.tolerance for frame in self.record.frames
        )

    def require_volumes(self, fingerprint: str, names: Sequence[str]) -> None:
        """Raise InputError unless the film shows the volumes with this joint fingerprint.

        names: the names of these volumes, for the message.
        """
        if fingerprint != self.record.volume.fingerprint:
            raise InputError(
                "the film was made from another volume",
                where=f"{self.path}: volume.fingerprint",
                got=f"the fingerprint {fingerprint} of {', '.join(names)}",
                expected=self.record.volume.fingerprint,
                hint="if the volume was moved, name it with --volume; draw another volume with another scene",
            )

    @property
    def is_complete(self) -> bool:
        """Return whether the film meets the accuracy that was requested."""
        return self.record.schedule.met and "total" in self.record.seconds

    def is_up_to_date(self, fingerprint: FilmFingerprint, output: OutputSpec, frames: Sequence[int]) -> bool:
        """Return whether this film is the requested one, has the requested accuracy, and has unchanged files."""
        return not self._change(fingerprint, frames) and self.is_complete and self._changed_file(output) is None

    def why_stale(self, fingerprint: FilmFingerprint, output: OutputSpec, frames: Sequence[int]) -> str:
        """Return why this film is not up to date, as the end of a sentence about it.

        It is empty for numbered frames of the same fingerprint, which are kept or redrawn one by one.
        """
        change = self._change(fingerprint, frames)
        if output.is_frames:
            is_kept = self.frames_digest == fingerprint.frames_digest
            return "" if is_kept else f"is another film and is drawn again: {change}"
        if not output.file.exists():
            return f"does not exist, and its sidecar describes another film: {change}" if change else ""
        if change:
            return f"is another film and is drawn again: {change}"
        if not self.is_complete:
            return "is less than what was requested and is drawn again"
        file = self._changed_file(output)
        why = "is not the file that its sidecar describes"
        if file is not None and file != output.file:
            is_gone = not (FRAME_FIELD.search(str(file)) or file.exists())
            why = f"has no {file} beside it" if is_gone else f"has another {file} beside it than its sidecar describes"
        return f"{why} and is drawn again"

    def _change(self, fingerprint: FilmFingerprint, frames: Sequence[int]) -> str:
        """Return, in words, how this film differs from the requested one; empty if it does not.

        fingerprint, frames: the fingerprint and the frames of the requested film.
        """
        own = self.record.fingerprint
        if own is None:
            return "one pass would not have made it"
        if change := own.of_frames.change(fingerprint.of_frames):
            return change
        if own.encoding != fingerprint.encoding or [*self.record.numbers] != [*frames]:
            return describe_differences(own.encoding, fingerprint.encoding) or "it has other frames"
        return ""

    def _changed_file(self, output: OutputSpec) -> Path | None:
        """Return the file of the first output that is not as it was written; None if all outputs are."""
        digests = [self.record.digest, *(each.digest for each in self.record.outputs)]
        if len(digests) != len(output.files):
            return output.file
        for each, digest in zip(output.files, digests, strict=True):
            if not all(made.is_unchanged for made in self._made_files(each, digest)):
                return each.file
        return None

    def _made_files(self, output: OutputFile, digest: str | None) -> Iterator[MadeFile]:
        """Yield the files of an output, with their recorded digests. digest: the digest of an output in one file."""
        if not output.is_frames:
            yield MadeFile(output.file, digest)
            return
        for frame in self.record.frames:
            if output.shows(frame.frame):
                yield MadeFile(frame_path(output.file, frame.frame), frame.digest_of(output.kind), output.kind)


def find_finished_film(sidecar: Path, note: Callable[[str], object]) -> FinishedFilm | None:
    """Return the film that a sidecar describes; None without a sidecar whose film a job can keep.

    note: a function that takes a sentence on why a sidecar cannot be used.
    """
    try:
        record = SIDECAR.find(sidecar)
    except InputError as error:
        note(f"{sidecar} is not a record that can be used: {_first_problem(error)}")
        return None
    return None if record is None or record.fingerprint is None else FinishedFilm(sidecar, record)


def _first_problem(error: InputError) -> str:
    if not isinstance(error, SceneError):
        return error.what
    first = error.problems[0]
    return f"{first.path}: {first.what}"
