"""The names of a film's files, without the numpy that writing them takes."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from renderer.scene import FRAME_FIELD, OutputSpec, Scene

# What is meant for FRAME_FIELD, well-formed or not: names that nobody has checked yet may have it.
ANY_FRAME_FIELD = re.compile(r"\{frame(:[^{}]*)?\}")


def frame_path(template: Path, frame: int) -> Path:
    """The name of one frame's file: `{frame}`, with a format such as `{frame:04}`, replaced by the number.

    Other braces are part of the name, as are other formats: some ask for gigabytes, or are none.
    """
    return Path(FRAME_FIELD.sub(lambda field: field.group().format(frame=frame), str(template)))


def sidecar_path(scene: Scene, frames: Sequence[int]) -> Path:
    """The JSON file beside the output of these frames of the scene's path."""
    return sidecar_path_of_file(scene.output.file, frames, scene.camera.path.frames)


def sidecar_path_of_file(file: Path, frames: Sequence[int], num_frames: int) -> Path:
    """`engine.mp4` has `engine.mp4.json`, and the template `frames/{frame:04}.png` has `frames/frames.json`.

    In a template the field becomes the word `frames`, so that two templates in one folder keep apart. So do parts of a
    path in one folder: frames 30 to 59 have `frames/frames.30-59.json`, every third of them `frames.30-57-by-3.json`,
    and a selection without a step has a name of its own, too.

    num_frames: of the whole path.
    """
    whole = _sidecar_path_of_whole_film(file)
    if not FRAME_FIELD.search(str(file)) or len(frames) == num_frames:
        return whole
    return whole.with_name(f"{whole.stem}.{_part_name(frames)}.json")


def _sidecar_path_of_whole_film(file: Path) -> Path:
    if FRAME_FIELD.search(str(file)):
        return Path(FRAME_FIELD.sub("frames", str(file))).with_suffix(".json")
    return file.with_name(f"{file.name}.json")


def _part_name(frames: Sequence[int]) -> str:
    """Of a part of a path: `30-59`, `30-57-by-3`, `7`."""
    first, last = frames[0], frames[-1]
    if len(frames) == 1:
        return str(first)
    step = frames[1] - first
    if list(frames) == list(range(first, last + 1, step)):
        return f"{first}-{last}" if step == 1 else f"{first}-{last}-by-{step}"
    digest = hashlib.blake2b(",".join(map(str, frames)).encode(), digest_size=4).hexdigest()
    return f"{first}-{last}-some-{digest}"


def unfinished_folder(output: OutputSpec) -> Path:
    """Where frames are kept while a film is not whole: `engine.mp4.unfinished`, `frames/frames.unfinished`.

    Of numbered files it is that of all parts of the path.
    """
    return _sidecar_path_of_whole_film(output.file).with_suffix(".unfinished")


def has_frame_files(output: OutputSpec) -> bool:
    """Whether each frame is a file of its own, there as soon as it is drawn."""
    return output.file.suffix.lower() == ".png"


def picture_shape(output: OutputSpec) -> tuple[int, int, int]:
    """(height, width, channels) of its pictures: RGB, with a transparent background RGBA."""
    width, height = output.size
    return height, width, 4 if output.background is None else 3


def is_numbered(output: OutputSpec) -> bool:
    """Whether frames have names of their own, so that jobs may share them; a still has not."""
    return FRAME_FIELD.search(str(output.file)) is not None


def film_path_of_sidecar(sidecar: Path, recorded: Path) -> Path:
    """The output that a sidecar belongs to by its name and place; `recorded` is where the output was once.

    `engine.mp4` for `engine.mp4.json` and for `engine.json`; frames keep their template.
    """
    if ANY_FRAME_FIELD.search(recorded.name) or not recorded.suffix:
        return sidecar.with_name(recorded.name) if recorded.name else recorded
    film = sidecar.with_suffix("")
    return film if film.suffix.lower() == recorded.suffix.lower() else film.with_name(f"{film.name}{recorded.suffix}")


def picture_files(output: OutputSpec, frames: Sequence[int]) -> Iterator[Path]:
    """The film, or the picture of each of these frames."""
    return (frame_path(output.file, frame) for frame in (frames if is_numbered(output) else frames[:1]))


def first_output_paths(scene: Scene, frames: Sequence[int]) -> tuple[Path, Path]:
    """The film or the picture of the first frame, and the sidecar: where what cannot be written shows at once."""
    return frame_path(scene.output.file, frames[0]), sidecar_path(scene, frames)
