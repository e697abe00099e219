"""Check that parts are of one film, and complete together."""

from __future__ import annotations

import json
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from renderer.errors import Problem
from renderer.film import bytes_digest, consecutive_ranges, picture_layout
from renderer.job.assemble.parts import Part
from renderer.record.film_record import FrameRecord
from renderer.record.fingerprint import differences
from renderer.scene import (
    FRAME_FIELD,
    PictureKind,
    first_few,
    first_output,
    format_value,
    schedule_to_dict,
    without_sources,
)
from renderer.system import join_lines

_MAX_SHOWN = 4


@dataclass(frozen=True)
class PickedFrame:
    """A frame of the film and the part that it is taken from."""

    number: int
    part: Part
    record: FrameRecord

    @property
    def file(self) -> Path:
        """Return the picture of the frame."""
        return self.part.file(self.number)


# Of one film


def film_problems(parts: Sequence[Part]) -> Iterator[Problem]:
    """Yield a problem for each part of another film than most parts are of."""
    identities = [json.dumps(_film_identity(part), sort_keys=True) for part in parts]
    usual = Counter(identities).most_common(1)[0][0]
    model = parts[identities.index(usual)]
    for part, identity in zip(parts, identities, strict=True):
        if identity != usual:
            found = list(differences(_film_identity(model), _film_identity(part)))
            got = first_few([f"{path} {format_value(value)}" for path, _, value in found], _MAX_SHOWN)
            expected = first_few([f"{path} {format_value(value)}" for path, value, _ in found], _MAX_SHOWN)
            location, expected = str(part.path), f"{expected}, as in {model.path}"
            yield Problem("", "a part of another film", got=got, expected=expected, location=location)


def _film_identity(part: Part) -> dict[str, Any]:
    """Return what all parts of a film share: what pixels depend on, except the machine, and the encoding."""
    recorded = part.record.scene
    scene = without_sources(recorded)
    output = {key: value for key, value in first_output(recorded).items() if key != "file"}
    left_out = ("tolerance", "probes") if part.has_goal else ("probes",)
    error = {key: value for key, value in recorded["error"].items() if key not in left_out}
    return {
        "scene": {**scene, "output": output, "error": error},
        "volume": {"fingerprint": part.record.volume.fingerprint},
        "schedule": {"requested": json.loads(json.dumps(schedule_to_dict(part.record.schedule.requested)))},
    }


# Complete


def pick_frames(parts: Sequence[Part], numbers: Iterable[int]) -> tuple[list[PickedFrame], list[Problem]]:
    """Return these frames, each from the first part that has it, and what keeps them from being a film."""
    found: dict[int, list[PickedFrame]] = {}
    for part in parts:
        for record in part.record.frames:
            found.setdefault(record.frame, []).append(PickedFrame(record.frame, part, record))
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
    """Yield a problem unless both parts have the frame in one file, or have drawn the same picture."""
    if first.record.digest != other.record.digest and first.file.resolve() != other.file.resolve():
        got, what = f"{first.file} and {other.file}", f"frame {first.number} differs between two parts"
        yield Problem("", what, got=got, hint="leave one of the parts out", location=str(other.part.path))


def _missing_problems(missing: Sequence[int], part: Part) -> Iterator[Problem]:
    gaps = consecutive_ranges(missing)
    if not gaps:
        return
    ranges = ", ".join(f"{start}:{stop}" for start, stop in gaps)
    verb = "frame is" if len(missing) == 1 else "frames are"
    commands = [_command(part, start, stop) for start, stop in gaps[:_MAX_SHOWN]]
    commands += ["and so on"] * (len(gaps) > _MAX_SHOWN)
    hint = join_lines(["draw them by:", *commands])
    yield Problem("", f"{len(missing)} {verb} in no part", got=f"no part with {ranges}", hint=hint)


def _command(part: Part, start: int, stop: int) -> str:
    """Return the command that draws these frames beside those of a part."""
    words = ["hsplat", "render", str(part.path)]
    if part.has_goal:
        ((name, value),) = schedule_to_dict(part.record.schedule.requested).items()
        words += ["--set", "error.tolerance=null", "--set", f"error.{name}={json.dumps(value)}"]
    template = part.template
    if not FRAME_FIELD.search(template.name):
        template = template.with_name(f"{template.stem}-{{frame:04}}{template.suffix}")
    return shlex.join([*words, "--frames", f"{start}:{stop}", "--output", str(template)])


# Unchanged


def file_problems(picked: Sequence[PickedFrame], kind: PictureKind) -> Iterator[Problem]:
    """Yield a problem for each picture that is missing, or was changed since it was drawn. kind: as expected."""
    missing: dict[Path, list[PickedFrame]] = {}
    by_digest = {frame.record.digest: frame.number for frame in picked}
    for frame in picked:
        try:
            why = _picture_problem(frame.file.read_bytes(), frame, kind, by_digest)
        except OSError:
            missing.setdefault(frame.part.path, []).append(frame)
            continue
        if why is not None:
            hint = f"remove it, and {shlex.join(['hsplat', 'render', str(frame.part.path)])} draws it again"
            yield Problem("", f"not the picture of frame {frame.number}", got=why, hint=hint, location=str(frame.file))
    for path, frames in missing.items():
        yield Problem(
            "",
            f"{len(frames)} of its pictures {'is' if len(frames) == 1 else 'are'} missing",
            got=f"no {frames[0].file}" + f" and {len(frames) - 1} more" * (len(frames) > 1),
            hint=f"{shlex.join(['hsplat', 'render', str(path)])} draws them again",
            location=str(path),
        )


def _picture_problem(
    content: bytes, frame: PickedFrame, kind: PictureKind, by_digest: Mapping[str | None, int]
) -> str | None:
    """Return what is wrong with a picture, or None."""
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
