"""Name the files of a film. Needs no numpy."""

from __future__ import annotations

import glob
import hashlib
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from renderer.scene import FRAME_FIELD, FilmScene, OutputFile

# Of the folders for frames of films that are not finished.
UNFINISHED_SUFFIX = ".unfinished"
# What is meant as FRAME_FIELD, well-formed or not, in names that are not checked yet.
ANY_FRAME_FIELD = re.compile(r"\{frame(:[^{}]*)?\}")


def frame_path(template: Path, frame: int) -> Path:
    """Return the name of one frame's file: `{frame}`, or `{frame:04}`, is replaced by the number.

    Other braces and formats stay part of the name, because some formats are invalid or ask for gigabytes.
    """
    return Path(FRAME_FIELD.sub(lambda field: field.group().format(frame=frame), str(template)))


def sidecar_path(scene: FilmScene, frames: Sequence[int]) -> Path:
    """Return the JSON file beside the output of these frames of the scene's path."""
    return sidecar_path_of_file(scene.output.file, frames, scene.num_frames)


def sidecar_path_of_file(file: Path, frames: Sequence[int], num_frames: int) -> Path:
    """Return the sidecar of an output file or template.

    `engine.mp4` has `engine.mp4.json`, and the template `frames/{frame:04}.png` has `frames/frames.json`: the field
    becomes the word `frames`, which keeps two templates in one folder apart. Parts of a path differ, too: frames 30 to
    59 have `frames/frames.30-59.json`, every third of them `frames.30-57-by-3.json`, and a selection without a step has
    a digest in its name.

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


def film_sidecars(file: Path) -> list[Path]:
    """Return the sidecars that exist beside an output file or template: of the whole film, and of its parts."""
    whole = _sidecar_path_of_whole_film(file)
    parts = sorted(whole.parent.glob(f"{glob.escape(whole.stem)}.*.json")) if FRAME_FIELD.search(str(file)) else []
    return [path for path in (whole, *parts) if path.exists()]


def _part_name(frames: Sequence[int]) -> str:
    """Return the name of a part of a path: `30-59`, `30-57-by-3`, `7`."""
    first, last = frames[0], frames[-1]
    if len(frames) == 1:
        return str(first)
    step = frames[1] - first
    if list(frames) == list(range(first, last + 1, step)):
        return f"{first}-{last}" if step == 1 else f"{first}-{last}-by-{step}"
    digest = hashlib.blake2b(",".join(map(str, frames)).encode(), digest_size=4).hexdigest()
    return f"{first}-{last}-some-{digest}"


def unfinished_folder(output: OutputFile) -> Path:
    """Return the folder for the lock and the unfinished work of a file: `engine.mp4.unfinished`.

    Numbered files share `frames/frames.unfinished`, as do all parts of a path.
    """
    return _sidecar_path_of_whole_film(output.file).with_suffix(UNFINISHED_SUFFIX)


def film_path_of_sidecar(sidecar: Path, recorded: Path) -> Path:
    """Return the output that a sidecar belongs to by its name and folder; `recorded` is the path in the sidecar.

    `engine.mp4` for `engine.mp4.json` and for `engine.json`; frames keep their template.
    """
    if ANY_FRAME_FIELD.search(recorded.name) or not recorded.suffix:
        return sidecar.with_name(recorded.name) if recorded.name else recorded
    film = sidecar.with_suffix("")
    return film if film.suffix.lower() == recorded.suffix.lower() else film.with_name(f"{film.name}{recorded.suffix}")


def picture_files(output: OutputFile, frames: Sequence[int]) -> Iterator[Path]:
    """Yield the film, or the picture of each of these frames that it shows."""
    shown = [frame for frame in frames if output.shows(frame)]
    return (frame_path(output.file, frame) for frame in (shown if output.is_numbered else shown[:1]))
