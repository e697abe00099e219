"""Whether parts are of one film, and together the whole of it."""

from __future__ import annotations

import json
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hsplat_cli.films.assemble.parts import Part
from renderer.errors import Problem
from renderer.film import Record, bytes_digest, png_shape
from renderer.runs import consecutive_ranges
from renderer.scene import FRAME_FIELD, format_value, join_keys, schedule_to_dict

_MOST_SHOWN = 4


@dataclass(frozen=True)
class PickedFrame:
    """A frame of the film, and the part that it is taken from."""

    number: int
    part: Part
    record: Record

    @property
    def file(self) -> Path:
        """The picture."""
        return self.part.file(self.number)


# One film


def film_problems(parts: Sequence[Part]) -> Iterator[Problem]:
    """Of each part that is of another film than most are: in what."""
    kinds = [json.dumps(_kind(part), sort_keys=True) for part in parts]
    usual = Counter(kinds).most_common(1)[0][0]
    model = parts[kinds.index(usual)]
    before = dict(_leaves(_kind(model)))
    for part, kind in zip(parts, kinds, strict=True):
        if kind != usual:
            now = dict(_leaves(_kind(part)))
            keys = [key for key in {**before, **now} if before.get(key, _MISSING) != now.get(key, _MISSING)]
            yield Problem(
                "",
                "a part of another film",
                got=_shown(keys, now),
                expected=f"{_shown(keys, before)}, as in {model.path}",
                location=str(part.path),
            )


def _kind(part: Part) -> dict[str, Any]:
    """What all parts of a film have in common: all that pixels depend on but for the machine, and how it is encoded."""
    scene = {key: value for key, value in part.scene.items() if key not in ("volume", "output", "error")}
    output = {key: value for key, value in part.scene.get("output", {}).items() if key != "file"}
    asked = part.asked and schedule_to_dict(part.asked)
    return {
        "scene": {**scene, "output": output, "error": error_without_schedule(part) if has_goal(part) else _error(part)},
        "volume": {"fingerprint": part.data["volume"]["fingerprint"]},
        "schedule": {"asked": json.loads(json.dumps(asked))},
    }


def has_goal(part: Part) -> bool:
    """Whether its tolerances were found: they are then different in each part."""
    return part.asked is not None and part.asked.goal is not None


def error_without_schedule(part: Part) -> dict[str, Any]:
    """The scene's section `error`, but for the tolerances."""
    return {key: value for key, value in _error(part).items() if key != "tolerance"}


def _error(part: Part) -> dict[str, Any]:
    return dict(part.scene.get("error", {}))


_MISSING = object()


def _leaves(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """The values in nested mappings and lists of mappings by their dotted paths."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _leaves(item, join_keys(path, key))
    elif isinstance(value, list) and any(isinstance(item, dict) for item in value):
        for index, item in enumerate(value):
            yield from _leaves(item, join_keys(path, index))
    else:
        yield path, value


def _shown(keys: Sequence[str], values: Mapping[str, Any]) -> str:
    named = [f"{key} {format_value(values[key])}" if key in values else f"no {key}" for key in keys[:_MOST_SHOWN]]
    more = [f"{len(keys) - _MOST_SHOWN} more"] * (len(keys) > _MOST_SHOWN)
    return ", ".join([*named, *more])


# The whole of it


def pick(parts: Sequence[Part], numbers: Iterable[int]) -> tuple[list[PickedFrame], list[Problem]]:
    """These frames, each from one of the parts that have it, and what keeps them from being a film."""
    found: dict[int, list[PickedFrame]] = {}
    for part in parts:
        for record in part.records:
            found.setdefault(record["frame"], []).append(PickedFrame(record["frame"], part, record))
    picked: list[PickedFrame] = []
    problems: list[Problem] = []
    missing: list[int] = []
    for number in numbers:
        if number not in found:
            missing.append(number)
            continue
        first, *others = found[number]
        picked.append(first)
        problems += [problem for other in others for problem in _duplicate_problems(first, other)]
    problems += _missing_problems(missing, parts[0])
    return picked, problems


def _duplicate_problems(first: PickedFrame, other: PickedFrame) -> Iterator[Problem]:
    """A frame in two parts may be in one file, or in two of the same bytes."""
    if first.file.resolve() == other.file.resolve():
        return
    contents = [_content(first.file), _content(other.file)]
    if None not in contents and contents[0] != contents[1]:
        got, what = f"{first.file} and {other.file}", f"frame {first.number} is in two parts, and not the same"
        yield Problem("", what, got=got, hint="leave one of the parts out", location=str(other.part.path))


def _missing_problems(missing: Sequence[int], part: Part) -> Iterator[Problem]:
    gaps = consecutive_ranges(missing)
    if not gaps:
        return
    ranges = ", ".join(f"{start}:{stop}" for start, stop in gaps)
    verb = "frame is" if len(missing) == 1 else "frames are"
    commands = [_command(part, start, stop) for start, stop in gaps[:_MOST_SHOWN]]
    commands += ["and so on"] * (len(gaps) > _MOST_SHOWN)
    hint = "these draw them:\n    " + "\n    ".join(commands)
    yield Problem("", f"{len(missing)} {verb} in no part", got=f"nothing of {ranges}", hint=hint)


def _command(part: Part, start: int, stop: int) -> str:
    """What draws these frames beside those of a part."""
    words = ["hsplat", "render", str(part.path)]
    if has_goal(part):
        assert part.asked is not None
        ((name, value),) = schedule_to_dict(part.asked).items()
        words += ["--set", "error.tolerance=null", "--set", f"error.{name}={json.dumps(value)}"]
    template = part.template
    if not FRAME_FIELD.search(template.name):
        template = template.with_name(f"{template.stem}-{{frame:04}}.png")
    return shlex.join([*words, "--frames", f"{start}:{stop}", "--output", str(template)])


# As they were drawn


def file_problems(picked: Sequence[PickedFrame], shape: tuple[int, int, int]) -> Iterator[Problem]:
    """Of each picture that is not there or not what it was when it was drawn: in what.

    shape: (height, width, channels) that they are to have.
    """
    gone: dict[Path, list[PickedFrame]] = {}
    without_digest: dict[Path, list[PickedFrame]] = {}
    by_digest = {frame.record["digest"]: frame.number for frame in picked if "digest" in frame.record}
    for frame in picked:
        content = _content(frame.file)
        if content is None:
            gone.setdefault(frame.part.path, []).append(frame)
        elif "digest" not in frame.record:
            without_digest.setdefault(frame.part.path, []).append(frame)
        elif why := _picture_problem(content, frame, shape, by_digest):
            hint = f"remove it, and {shlex.join(['hsplat', 'render', str(frame.part.path)])} draws it again"
            yield Problem("", f"not the picture of frame {frame.number}", got=why, hint=hint, location=str(frame.file))
    for path, frames in gone.items():
        yield Problem(
            "",
            f"{len(frames)} of its pictures {'is' if len(frames) == 1 else 'are'} not there",
            got=f"no {frames[0].file}" + f" and {len(frames) - 1} more" * (len(frames) > 1),
            hint=f"{shlex.join(['hsplat', 'render', str(path)])} draws them again",
            location=str(path),
        )
    for path, frames in without_digest.items():
        yield Problem(
            "",
            "nothing tells whether its pictures are those that were drawn",
            got=f"no digest of frame {frames[0].number}" + f" and {len(frames) - 1} more" * (len(frames) > 1),
            hint=f"{shlex.join(['hsplat', 'render', str(path), '--force'])} draws them again",
            location=str(path),
        )


def _picture_problem(
    content: bytes, frame: PickedFrame, shape: tuple[int, int, int], by_digest: Mapping[str, int]
) -> str | None:
    """What is wrong with a picture; None if nothing is."""
    try:
        found = png_shape(content)
    except ValueError as error:
        return f"a file that is {error}"
    if found != shape:
        return f"{_size(found)}, not {_size(shape)}"
    mark = bytes_digest(content)
    if frame.record["digest"] == mark:
        return None
    return f"that of frame {by_digest[mark]}" if mark in by_digest else "another picture than the one that was drawn"


def _size(shape: tuple[int, int, int]) -> str:
    return f"{shape[1]} x {shape[0]} pixels with{'' if shape[2] == 4 else 'out'} alpha"


def _content(file: Path) -> bytes | None:
    try:
        return file.read_bytes()
    except OSError:
        return None
