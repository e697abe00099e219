"""The names of a film's files, without the numpy that writing them takes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from renderer.scene import OutputSpec

FRAME_FIELD = re.compile(r"\{frame(:[^{}]*)?\}")


def frame_path(template: Path, frame: int) -> Path:
    """The name of one frame's file: `{frame}`, with a format such as `{frame:04}`, replaced by the number.

    Other braces are part of the name.
    """
    return Path(FRAME_FIELD.sub(lambda field: field.group().format(frame=frame), str(template)))


def sidecar_path(output_file: Path) -> Path:
    """`engine.mp4` has `engine.mp4.json`, and the template `frames/{frame:04}.png` has `frames/frames.json`.

    In a template the field becomes the word `frames`, so that two templates in one folder keep apart.
    """
    name = str(output_file)
    if FRAME_FIELD.search(name):
        return Path(FRAME_FIELD.sub("frames", name)).with_suffix(".json")
    return output_file.with_name(f"{output_file.name}.json")


def unfinished_folder(sidecar: Path) -> Path:
    """Where frames are kept while a film is not whole: `engine.mp4.unfinished`, `frames/frames.unfinished`."""
    return sidecar.with_suffix(".unfinished")


def has_frame_files(output: OutputSpec) -> bool:
    """Whether each frame is a file of its own, there as soon as it is drawn."""
    return output.file.suffix.lower() == ".png"


def is_numbered(output: OutputSpec) -> bool:
    """Whether frames have names of their own, so that jobs may share them; a still has not."""
    return FRAME_FIELD.search(str(output.file)) is not None


def film_beside(sidecar: Path, recorded: Path) -> Path:
    """The output that a sidecar belongs to by its name and place; `recorded` is where the output was once.

    `engine.mp4` for `engine.mp4.json` and for `engine.json`; frames keep their template.
    """
    if FRAME_FIELD.search(recorded.name) or not recorded.suffix:
        return sidecar.with_name(recorded.name) if recorded.name else recorded
    film = sidecar.with_suffix("")
    return film if film.suffix.lower() == recorded.suffix.lower() else film.with_name(f"{film.name}{recorded.suffix}")


def first_files(output: OutputSpec, frames: Sequence[int]) -> tuple[Path, Path]:
    """The film or the picture of the first frame, and the sidecar: where what cannot be written shows at once."""
    return frame_path(output.file, frames[0]), sidecar_path(output.file)
