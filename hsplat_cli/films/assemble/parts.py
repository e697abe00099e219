"""Find and read the parts of a film: sidecars of numbered frames, in folders or by name."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hsplat_cli.scenes import Sidecar, expand_pattern, is_shallow, parse_sidecar, read_known_fields, text_at
from renderer.errors import InputError, Problem, SceneError
from renderer.film import Record, film_path_of_sidecar, frame_path, is_frame_record
from renderer.scene import (
    BOOLEAN_FIELD,
    MAPPING_FIELD,
    MAX_FRAMES,
    OUTPUT_FILE_FIELD,
    TEXT_FIELD,
    ErrorSpec,
    FieldTable,
    FieldType,
    TreeNode,
    format_value,
    read_content,
)

_EXPECTED = "a folder of numbered frames, or the .json files beside them"

# No measured value comes near it, and sums over all parts stay finite.
_MAX_AMOUNT = 1e100
# More levels than any sidecar has that this program wrote.
_MAX_LEVELS = 20


@dataclass(frozen=True)
class Part:
    """Frames that one job has drawn.

    path: of the sidecar. data: its content, with the scene and the records of the frames, ascending.
    requested_error: the accuracy that was requested. template: the names of the pictures, beside the sidecar wherever
    it is now.
    """

    path: Path
    data: Mapping[str, Any]
    scene: Mapping[str, Any]
    records: Sequence[Record]
    requested_error: ErrorSpec
    template: Path

    @property
    def num_frames(self) -> int:
        """Return the number of frames of the whole path."""
        return int(self.scene["camera"]["path"]["frames"])

    @property
    def has_goal(self) -> bool:
        """Return whether its tolerances were found for a goal, so that they differ from part to part."""
        return self.requested_error.goal is not None

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
            problems.append(_problem(error, name))
            continue
        for path in paths:
            for part in _parts_at(path, problems):
                parts[part.path.resolve()] = part
    if problems:
        raise SceneError(problems)
    return sorted(parts.values(), key=lambda part: (part.records[0]["frame"], str(part.path)))


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
        content = read_content(path)
        sidecar = parse_sidecar(content, path)
    except SceneError as error:
        problems.extend(error.problems)
        return
    except InputError as error:
        problems.append(_problem(error, str(path)))
        return
    data = json.loads(content) if sidecar else {}
    file = text_at(data, "scene", "output", "file")
    if sidecar is None or file is None or not file.lower().endswith(".png"):
        if is_named:
            what = "not the sidecar of numbered frames" if sidecar is None else "the sidecar of a film in one file"
            problems.append(Problem("", what, expected=_EXPECTED, location=str(path)))
        return
    wrong = sidecar.problems or [*_record_problems(data, path), *_content_problems(data)] or _path_problems(sidecar)
    if wrong:
        problems.extend(replace(problem, location=str(path)) for problem in wrong)
        return
    template = film_path_of_sidecar(path, Path(file))
    yield Part(path, data, data["scene"], data["frames"], sidecar.requested_error, template)


def _problem(error: InputError, place: str) -> Problem:
    return Problem("", error.what, error.got, error.expected, error.hint, location=error.where or place)


def _record_problems(data: Mapping[str, Any], path: Path) -> Iterator[Problem]:
    """Yield a problem of the first incomplete frame; others may be incomplete for the same reason."""
    for index, record in enumerate(data["frames"]):
        if not is_frame_record(record):
            expected = "digest, tolerance, cells, splats and seconds, as this version writes them"
            hint = f"{shlex.join(['hsplat', 'render', str(path), '--force'])} draws them again"
            yield Problem(f"frames.{index}", "an incomplete record of a frame", expected=expected, hint=hint)
            return


def _path_problems(sidecar: Sidecar) -> list[Problem]:
    num_frames, last = sidecar.scene["camera"]["path"]["frames"], sidecar.frames[-1]
    if type(num_frames) is int and last < num_frames <= MAX_FRAMES:
        return []
    expected = f"a whole number greater than {last}, the last frame"
    return [Problem("scene.camera.path.frames", "not the length of this path", str(num_frames), expected)]


# What a film of parts takes over from their sidecars, which may have been edited


def _content_problems(data: Mapping[str, Any]) -> list[Problem]:
    """Return what is wrong with the content of a part's sidecar, besides what `parse_sidecar` checks."""
    if not is_shallow(data, _MAX_LEVELS):
        return [Problem("", "too many levels", expected=f"at most {_MAX_LEVELS}")]
    problems: list[Problem] = []
    _PART.read(TreeNode(data, "", problems))
    return problems


def _parse_amount(node: TreeNode) -> Any:
    """Check a number that is copied into the next sidecar, so text that spells a number is refused."""
    value: Any = node.value
    if type(value) not in (int, float):
        return _AMOUNT.reject(node, "not a number", got=format_value(value))
    return value if 0 <= value <= _MAX_AMOUNT else _AMOUNT.reject(node, "out of range")


_AMOUNT: FieldType[Any] = FieldType(f"a number from 0 to {_MAX_AMOUNT:g}", _parse_amount)


def _mapping(table: FieldTable, optional: str = "") -> FieldType[Any]:
    """Return the type of a mapping that has these keys, of which one is optional, and perhaps others."""
    required = [key for key in table if key != optional]
    return FieldType("a mapping", lambda node: read_known_fields(node, table, required=required))


def _all(kind: type[dict[Any, Any]] | type[list[Any]], expected: str, item: FieldType[Any]) -> FieldType[Any]:
    """Return the type of a mapping or a list of such items."""

    def parse(node: TreeNode) -> Any:
        value: Any = node.value
        if not isinstance(value, kind):
            return found.reject(node, f"not {expected}")
        for key, each in value.items() if isinstance(value, dict) else enumerate(value):
            item.read(node.child(key, each))
        return value

    found: FieldType[Any] = FieldType(expected, parse)
    return found


_SCHEDULE: FieldTable = {"met": BOOLEAN_FIELD, "reproducible": BOOLEAN_FIELD, "shortfall": TEXT_FIELD}
_PART = _mapping(
    {
        "scene": _mapping(
            {
                "output": _mapping({"file": OUTPUT_FILE_FIELD}),
                "camera": _mapping({"path": _mapping({"frames": _AMOUNT})}),
                "error": MAPPING_FIELD,
            }
        ),
        "camera": MAPPING_FIELD,
        "pyramid": _mapping({"finest_level_drawn": _AMOUNT}),
        "gl": TEXT_FIELD,
        "versions": _all(dict, "a mapping", TEXT_FIELD),
        "schedule": _mapping(_SCHEDULE, optional="shortfall"),
        "notes": _all(list, "a list", TEXT_FIELD),
        "seconds": _all(dict, "a mapping", _AMOUNT),
    }
)
