"""Find and read the parts of a film: sidecars of numbered frames, in folders or by name."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from renderer.errors import InputError, Problem, SceneError
from renderer.job.inputs import expand_pattern
from renderer.record import FilmRecord, FinishedFilm, late_frame_problems, parse_film_record
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

# The inputs in which parts of a film are found, in the words of an error.
_EXPECTED = "a folder of numbered frames, or the .json files beside them"


def find_parts(names: Sequence[str]) -> list[FinishedFilm]:
    """Return the parts in these folders, sidecars and glob patterns, each once, sorted by their first frame.

    Raises SceneError with the problems of all parts.
    """
    parts: dict[Path, FinishedFilm] = {}
    problems: list[Problem] = []
    for name in names:
        try:
            paths = expand_pattern(name)
        except InputError as error:
            problems.append(error.problem_at(name))
            continue
        for path in paths:
            for part in _parts_at(path, problems):
                parts[part.path.resolve()] = part
    raise_problems(problems)
    return sorted(parts.values(), key=lambda part: (part.record.numbers[0], str(part.path)))


def _parts_at(path: Path, problems: list[Problem]) -> Iterator[FinishedFilm]:
    """Yield the part of a sidecar, or all parts in a folder. Other files in the folder are ignored."""
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


def _read(path: Path, problems: list[Problem], *, is_named: bool) -> Iterator[FinishedFilm]:
    try:
        record = parse_film_record(read_content(path), path)
    except SceneError as error:
        problems.extend(error.problems)
        return
    except InputError as error:
        problems.append(error.problem_at(str(path)))
        return
    if record is None or not _has_frames(record):
        if is_named:
            what = "not the sidecar of numbered frames" if record is None else "the sidecar of a film in one file"
            problems.append(Problem("", what, expected=_EXPECTED, location=str(path)))
        return
    wrong = [*_scene_problems(record), *_digest_problems(record, path)]
    problems.extend(replace(problem, location=str(path)) for problem in wrong)
    if not wrong:
        yield FinishedFilm(path, record)


def _has_frames(record: FilmRecord) -> bool:
    file = first_output(record.scene).get("file")
    return isinstance(file, str) and output_suffix(file) in FRAME_SUFFIXES


def _digest_problems(record: FilmRecord, path: Path) -> Iterator[Problem]:
    """Yield a problem for the first frame without a digest. Other frames may lack theirs for the same reason."""
    index = next((index for index, frame in enumerate(record.frames) if frame.digest is None), None)
    if index is not None:
        hint = f"{shlex.join(['hsplat', 'render', str(path), '--force'])} draws the frames again"
        yield Problem(f"frames.{index}.digest", "missing", expected="the digest of its picture", hint=hint)


def _scene_problems(record: FilmRecord) -> list[Problem]:
    """Return the problems of the values that an assembled film takes from the recorded scene."""
    problems: list[Problem] = []
    node = schema.TreeNode(record.scene, "scene", problems, film=schema.FilmTime(None, 1.0))
    node = replace(node, value={**record.scene, "output": first_output(record.scene)})
    table = {"output": _known({"file": OUTPUT_FILE_FIELD}), "camera": CAMERA_FIELD, "error": schema.MAPPING_FIELD}
    found = _known(table).read(node)
    return problems or late_frame_problems(record, found["camera"].num_frames)


def _known(table: schema.FieldTable) -> schema.FieldType[Any]:
    """Return the type of a field that is a mapping with all keys of a table. Other keys of the mapping are ignored."""

    def parse(node: schema.TreeNode) -> Any:
        if isinstance(node.value, Mapping):
            node = replace(node, value={key: node.value[key] for key in table if key in node.value})
        return schema.read_fields(node, table, required=table)

    return schema.FieldType("a mapping", parse)
