"""Find and read the parts of a film: sidecars of numbered frames, in folders or by name."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from renderer.errors import InputError, Problem, SceneError
from renderer.film import film_path_of_sidecar, frame_path
from renderer.job.inputs import expand_pattern
from renderer.record.film_record import FilmRecord, late_frame_problems, parse_film_record
from renderer.scene import (
    CAMERA_FIELD,
    FRAME_SUFFIXES,
    OUTPUT_FILE_FIELD,
    first_output,
    output_suffix,
    raise_problems,
    read_content,
    schema,
)

_EXPECTED = "a folder of numbered frames, or the .json files beside them"


@dataclass(frozen=True)
class Part:
    """A part of a film: frames that one job has drawn.

    path: of the sidecar. template: the names of the pictures, beside the sidecar wherever it is now.
    """

    path: Path
    record: FilmRecord
    template: Path

    @property
    def num_frames(self) -> int:
        """Return the number of frames of the whole path."""
        camera = schema.TreeNode(self.record.scene["camera"], "camera", [], film=schema.FilmTime(None, 1.0))
        return CAMERA_FIELD.read(camera).num_frames

    @property
    def has_goal(self) -> bool:
        """Return whether its tolerances were found for a goal, so that they differ from part to part."""
        return self.record.schedule.requested.goal is not None

    def file(self, number: int) -> Path:
        """Return the picture of a frame."""
        return frame_path(self.template, number)


def find_parts(names: Sequence[str]) -> list[Part]:
    """Return the parts in these folders, sidecars and globs, each once, sorted by their first frame.

    Raises SceneError with all that is wrong with any of them.
    """
    parts: dict[Path, Part] = {}
    problems: list[Problem] = []
    for name in names:
        try:
            paths = expand_pattern(name)
        except InputError as error:
            problems.append(problem_of(error, name))
            continue
        for path in paths:
            for part in _parts_at(path, problems):
                parts[part.path.resolve()] = part
    raise_problems(problems)
    return sorted(parts.values(), key=lambda part: (part.record.numbers[0], str(part.path)))


def _parts_at(path: Path, problems: list[Problem]) -> Iterator[Part]:
    """Yield the part of a sidecar, or those in a folder, whose other files are ignored."""
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
        record = parse_film_record(read_content(path), path)
    except SceneError as error:
        problems.extend(error.problems)
        return
    except InputError as error:
        problems.append(problem_of(error, str(path)))
        return
    if record is None or not _has_frames(record):
        if is_named:
            what = "not the sidecar of numbered frames" if record is None else "the sidecar of a film in one file"
            problems.append(Problem("", what, expected=_EXPECTED, location=str(path)))
        return
    wrong = [*_scene_problems(record), *_digest_problems(record, path)]
    problems.extend(replace(problem, location=str(path)) for problem in wrong)
    if not wrong:
        yield Part(path, record, film_path_of_sidecar(path, Path(first_output(record.scene)["file"])))


def _has_frames(record: FilmRecord) -> bool:
    file = first_output(record.scene).get("file")
    return isinstance(file, str) and output_suffix(file) in FRAME_SUFFIXES


def problem_of(error: InputError, place: str) -> Problem:
    """Return the problem that an error is. place: where that is, unless the error says it."""
    return Problem("", error.what, error.got, error.expected, error.hint, location=error.where or place)


def _digest_problems(record: FilmRecord, path: Path) -> Iterator[Problem]:
    """Yield a problem of the first frame without a digest; others may have none for the same reason."""
    index = next((index for index, frame in enumerate(record.frames) if frame.digest is None), None)
    if index is not None:
        hint = f"{shlex.join(['hsplat', 'render', str(path), '--force'])} draws the frames again"
        yield Problem(f"frames.{index}.digest", "missing", expected="the digest of its picture", hint=hint)


def _scene_problems(record: FilmRecord) -> list[Problem]:
    """Return what is wrong with what a film of parts takes from the recorded scene."""
    problems: list[Problem] = []
    node = schema.TreeNode(record.scene, "scene", problems, film=schema.FilmTime(None, 1.0))
    node = replace(node, value={**record.scene, "output": first_output(record.scene)})
    table = {"output": _known({"file": OUTPUT_FILE_FIELD}), "camera": CAMERA_FIELD, "error": schema.MAPPING_FIELD}
    found = _known(table).read(node)
    return problems or late_frame_problems(record, found["camera"].num_frames)


def _known(table: schema.FieldTable) -> schema.FieldType[Any]:
    """Return the type of a mapping that has these keys, and perhaps others."""

    def parse(node: schema.TreeNode) -> Any:
        if isinstance(node.value, Mapping):
            node = replace(node, value={key: node.value[key] for key in table if key in node.value})
        return schema.read_fields(node, table, required=table)

    return schema.FieldType("a mapping", parse)
