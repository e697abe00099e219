"""Find the pictures of finished films that are missing, or were changed since they were drawn."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from renderer.errors import Problem
from renderer.film import bytes_digest, picture_layout
from renderer.record.film_record import FrameRecord
from renderer.record.finished_film import FinishedFilm
from renderer.scene import PictureKind


@dataclass(frozen=True)
class FrameFile:
    """A file with the picture of one frame of a finished film."""

    film: FinishedFilm
    record: FrameRecord
    file: Path

    @property
    def number(self) -> int:
        """Return the number of the frame."""
        return self.record.frame


def picture_problems(frames: Sequence[FrameFile], kind: PictureKind) -> Iterator[Problem]:
    """Yield a problem for each picture that is missing, or was changed since it was drawn.

    kind: the kind that the pictures should have.
    """
    missing: dict[Path, list[FrameFile]] = {}
    by_digest = {frame.record.digest: frame.number for frame in frames}
    for frame in frames:
        try:
            why = _picture_problem(frame.file.read_bytes(), frame, kind, by_digest)
        except OSError:
            missing.setdefault(frame.film.path, []).append(frame)
            continue
        if why is not None:
            hint = f"remove it, and {shlex.join(['hsplat', 'render', str(frame.film.path)])} draws it again"
            yield Problem("", f"not the picture of frame {frame.number}", got=why, hint=hint, location=str(frame.file))
    for path, lost in missing.items():
        yield Problem(
            "",
            f"{len(lost)} of its pictures {'is' if len(lost) == 1 else 'are'} missing",
            got=f"no {lost[0].file}" + f" and {len(lost) - 1} more" * (len(lost) > 1),
            hint=f"{shlex.join(['hsplat', 'render', str(path)])} draws them again",
            location=str(path),
        )


def _picture_problem(
    content: bytes, frame: FrameFile, kind: PictureKind, by_digest: Mapping[str | None, int]
) -> str | None:
    """Return the fault of a picture as a phrase; None for the expected picture.

    content: the content of the file. by_digest: the numbers of all frames by the digests of their pictures.
    """
    try:
        found, depth = picture_layout(content)
    except ValueError as error:
        return f"a file that is {error}"
    if found != kind.shape:
        return f"{_size(found)}, not {_size(kind.shape)}"
    if depth != kind.depth:
        return f"{depth} bits a channel, not {kind.depth}"
    digest = bytes_digest(content)
    if frame.record.digest == digest:
        return None
    return f"that of frame {by_digest[digest]}" if digest in by_digest else "a picture that was changed since"


def _size(shape: tuple[int, int, int]) -> str:
    return f"{shape[1]} x {shape[0]} pixels with{'' if shape[2] == 4 else 'out'} alpha"
