"""Name the files of a film, without loading numpy."""

from __future__ import annotations

import glob
import hashlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from renderer.scene import FRAME_FIELD, FilmScene, OutputFile

# The suffix of the folders for unfinished work.
UNFINISHED_SUFFIX = ".unfinished"

# A part of a file name in braces that is probably meant as the field for the frame's number, even if it is malformed.
ANY_FRAME_FIELD = re.compile(r"\{frame(:[^{}]*)?\}")


def frame_path(template: Path, frame: int) -> Path:
    """Return the path of one frame's file: the number replaces `{frame}` or `{frame:04}` in the template.

    Fields with other formats stay part of the name, as some are invalid or would make names of gigabytes.
    """
    return Path(FRAME_FIELD.sub(lambda field: field.group().format(frame=frame), str(template)))


def sidecar_path(scene: FilmScene, frames: Sequence[int]) -> Path:
    """Return the path of the sidecar, the JSON file beside the output, for some frames of a scene."""
    return sidecar_path_of_file(scene.output.file, frames, scene.num_frames)


def sidecar_path_of_file(file: Path, frames: Sequence[int], num_frames: int) -> Path:
    """Return the path of the sidecar of an output file or template.

    `engine.mp4` has `engine.mp4.json`, and the template `frames/{frame:04}.png` has `frames/frames.json`: the word
    `frames` replaces the field, so that two templates in one folder have different sidecars. Parts of a film have
    sidecars of their own: frames 30 to 59 have `frames/frames.30-59.json`, every third of them
    `frames.30-57-by-3.json`, and a selection without a regular step has a digest in its name.

    num_frames: the number of frames of the whole film.
    """
    whole = _sidecar_path_of_whole_film(file)
    if not FRAME_FIELD.search(str(file)) or len(frames) == num_frames:
        return whole
    return whole.with_name(f"{whole.stem}.{_part_name(frames)}.json")


def _sidecar_path_of_whole_film(file: Path) -> Path:
    if FRAME_FIELD.search(str(file)):
        return Path(FRAME_FIELD.sub("frames", str(file))).with_suffix(".json")
    return file.with_name(f"{file.name}.json")


def film_sidecars(file: Path) -> list[Path]:
    """Return the existing sidecars of an output file or template, of the whole film and of its parts."""
    whole = _sidecar_path_of_whole_film(file)
    parts = sorted(whole.parent.glob(f"{glob.escape(whole.stem)}.*.json")) if FRAME_FIELD.search(str(file)) else []
    return [path for path in (whole, *parts) if path.exists()]


def _part_name(frames: Sequence[int]) -> str:
    """Return the name of a part of a film, such as `30-59`, `30-57-by-3` or `7`."""
    first, last = frames[0], frames[-1]
    if len(frames) == 1:
        return str(first)
    step = frames[1] - first
    if list(frames) == list(range(first, last + 1, step)):
        return f"{first}-{last}" if step == 1 else f"{first}-{last}-by-{step}"
    digest = hashlib.blake2b(",".join(map(str, frames)).encode(), digest_size=4).hexdigest()
    return f"{first}-{last}-some-{digest}"


def unfinished_folder(output: OutputFile) -> Path:
    """Return the folder for the lock and the unfinished work of an output file, such as `engine.mp4.unfinished`.

    Numbered files share one folder, `frames/frames.unfinished`, and so do all parts of a film.
    """
    return _sidecar_path_of_whole_film(output.file).with_suffix(UNFINISHED_SUFFIX)


def film_path_of_sidecar(sidecar: Path, recorded: Path) -> Path:
    """Return the path of the output of a sidecar, by the sidecar's name and folder.

    It is `engine.mp4` for `engine.mp4.json` and for `engine.json`. recorded: the path of the output in the sidecar; a
    template for numbered frames.
    """
    if ANY_FRAME_FIELD.search(recorded.name) or not recorded.suffix:
        return sidecar.with_name(recorded.name) if recorded.name else recorded
    film = sidecar.with_suffix("")
    return film if film.suffix.lower() == recorded.suffix.lower() else film.with_name(f"{film.name}{recorded.suffix}")


def picture_files(output: OutputFile, frames: Sequence[int]) -> Iterator[Path]:
    """Yield the only file of an output or, for a numbered output, the file of each of these frames that it shows."""
    shown = [frame for frame in frames if output.shows(frame)]
    return (frame_path(output.file, frame) for frame in (shown if output.is_numbered else shown[:1]))
