"""The parts of a film: sidecars of numbered frames, found in folders or by name, and read."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hsplat_cli.films.assemble.part_schema import part_problems
from hsplat_cli.scenes import Sidecar, expand_pattern, parse_sidecar
from renderer.errors import InputError, Problem, SceneError
from renderer.film import Record, film_path_of_sidecar, frame_path, is_frame_record
from renderer.scene import MAX_FRAMES, OUTPUT_FILE_FIELD, ErrorSpec, TreeNode, read_content

_EXPECTED = "a folder of numbered frames, or the .json files beside them"


@dataclass(frozen=True)
class Part:
    """Frames that one job has drawn.

    path: of the sidecar. data: all that is in it. asked: how exact it was to be, where that is told.
    template: the names of its pictures, beside the sidecar wherever that is now.
    """

    path: Path
    data: Mapping[str, Any]
    asked: ErrorSpec | None
    template: Path

    @property
    def scene(self) -> Mapping[str, Any]:
        """As plain data."""
        scene: Mapping[str, Any] = self.data["scene"]
        return scene

    @property
    def records(self) -> Sequence[Record]:
        """Of its frames, ascending."""
        records: Sequence[Record] = self.data["frames"]
        return records

    @property
    def num_frames(self) -> int:
        """Of the whole path."""
        return int(self.scene["camera"]["path"]["frames"])

    def file(self, number: int) -> Path:
        """The picture of a frame."""
        return frame_path(self.template, number)


def find_parts(names: Sequence[str]) -> list[Part]:
    """The parts in these folders, sidecars and globs, each once, by their first frame.

    Raises SceneError with all that is wrong with any of them.
    """
    parts: dict[Path, Part] = {}
    problems: list[Problem] = []
    for name in names:
        for path in _expand_name(name, problems):
            for part in _parts_at(path, problems):
                parts[part.path.resolve()] = part
    if problems:
        raise SceneError(problems)
    return sorted(parts.values(), key=lambda part: (part.records[0]["frame"], str(part.path)))


def _expand_name(name: str, problems: list[Problem]) -> list[Path]:
    """What a glob matches; any other name as it is."""
    try:
        return expand_pattern(name)
    except InputError as error:
        problems.append(_problem(error, name))
        return []


def _parts_at(path: Path, problems: list[Problem]) -> Iterator[Part]:
    """The part of a sidecar, or those of a folder, where other files are no matter."""
    if not path.is_dir():
        yield from _read(path, problems, is_named=True)
        return
    num_before, found = len(problems), False
    for file in sorted(path.glob("*.json")):
        for part in _read(file, problems, is_named=False):
            found = True
            yield part
    if not found and len(problems) == num_before:
        hint = "`hsplat render SCENE --frames 0:30 --output 'parts/{frame:04}.png'` draws a part"
        problems.append(
            Problem("", "no numbered frames with their sidecar in this folder", hint=hint, location=str(path))
        )


def _read(path: Path, problems: list[Problem], *, is_named: bool) -> Iterator[Part]:
    try:
        content = read_content(path)
        sidecar = parse_sidecar(content, path)
    except SceneError as error:
        problems.extend(error.problems)
        return
    except InputError as error:
        problems.append(_problem(error, str(path)))
        return
    file = _output_file(sidecar)
    if sidecar is None or file is None or file.suffix.lower() != ".png":
        if is_named:
            what = "not the sidecar of numbered frames" if sidecar is None else "a film, which is not taken apart again"
            problems.append(Problem("", what, expected=_EXPECTED, location=str(path)))
        return
    data = json.loads(content)
    wrong = [*sidecar.problems, *_file_problems(sidecar)] or [
        *_record_problems(data),
        *part_problems(data),
        *_path_problems(sidecar),
    ]
    if wrong:
        problems.extend(replace(problem, location=str(path)) for problem in wrong)
        return
    yield Part(path, data, sidecar.original.requested_error, film_path_of_sidecar(path, file))


def _problem(error: InputError, place: str) -> Problem:
    return Problem("", error.what, error.got, error.expected, error.hint, location=error.where or place)


def _output_file(sidecar: Sidecar | None) -> Path | None:
    output = sidecar.scene.get("output") if sidecar else None
    file = output.get("file") if isinstance(output, dict) else None
    return Path(file) if isinstance(file, str) else None


def _file_problems(sidecar: Sidecar) -> list[Problem]:
    """Of the names of its pictures, as in a scene: they may have been changed by hand."""
    problems: list[Problem] = []
    OUTPUT_FILE_FIELD.read(TreeNode(sidecar.scene["output"]["file"], "scene.output.file", problems))
    return problems


def _record_problems(data: Mapping[str, Any]) -> Iterator[Problem]:
    """Of the first frame that says too little: the others may for the same reason."""
    for index, record in enumerate(data["frames"]):
        if not is_frame_record(record, has_digest=False):
            expected = "tolerance, cells, splats and seconds, as this version writes them"
            yield Problem(f"frames.{index}", "a frame with too little about it", expected=expected)
            return


def _path_problems(sidecar: Sidecar) -> Iterator[Problem]:
    camera = sidecar.scene.get("camera")
    path = camera.get("path") if isinstance(camera, dict) else None
    num_frames = path.get("frames") if isinstance(path, dict) else None
    if type(num_frames) is not int or not sidecar.frames[-1] < num_frames <= MAX_FRAMES:
        expected = f"a whole number greater than {sidecar.frames[-1]}, the last frame"
        yield Problem("scene.camera.path.frames", "not the length of this path", str(num_frames), expected)
