"""Check that the parts to assemble belong to one film, and that they have all of its frames."""

from __future__ import annotations

import json
import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence

from renderer.errors import Problem
from renderer.film import consecutive_ranges
from renderer.record import FinishedFilm, FrameFile, differences
from renderer.scene import (
    FRAME_FIELD,
    first_few,
    first_output,
    format_value,
    schedule_to_dict,
    without_sources,
)
from renderer.system import join_lines

# The largest number of differences between two parts, or of commands for missing frames, that an error shows.
_MAX_SHOWN = 4


# Whether parts belong to one film


def film_problems(parts: Sequence[FinishedFilm]) -> Iterator[Problem]:
    """Yield a problem for each part that belongs to another film than the majority."""
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


def _film_identity(part: FinishedFilm) -> dict[str, object]:
    """Return the data that all parts of a film share: the encoding, and all that pixels depend on but the machine."""
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


# Whether parts have all frames of the film


def pick_frames(parts: Sequence[FinishedFilm], numbers: Iterable[int]) -> tuple[list[FrameFile], list[Problem]]:
    """Return the files of these frames, each from the first part that has it, and the problems of the parts.

    There is one problem for all frames that no part has, and one for each frame that differs between two parts.
    """
    found: dict[int, list[FrameFile]] = {}
    for part in parts:
        for record in part.record.frames:
            found.setdefault(record.frame, []).append(FrameFile(part, record, part.frame_file(record.frame)))
    picked: list[FrameFile] = []
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


def _duplicate_problems(first: FrameFile, other: FrameFile) -> Iterator[Problem]:
    """Yield a problem unless both parts have the frame in the same file, or have drawn the same picture."""
    if first.record.digest != other.record.digest and first.file.resolve() != other.file.resolve():
        got, what = f"{first.file} and {other.file}", f"frame {first.number} differs between two parts"
        yield Problem("", what, got=got, hint="leave one of the parts out", location=str(other.film.path))


def _missing_problems(missing: Sequence[int], part: FinishedFilm) -> Iterator[Problem]:
    gaps = consecutive_ranges(missing)
    if not gaps:
        return
    ranges = ", ".join(f"{start}:{stop}" for start, stop in gaps)
    verb = "frame is" if len(missing) == 1 else "frames are"
    commands = [_command(part, start, stop) for start, stop in gaps[:_MAX_SHOWN]]
    commands += ["and so on"] * (len(gaps) > _MAX_SHOWN)
    hint = join_lines(["draw them by:", *commands])
    yield Problem("", f"{len(missing)} {verb} in no part", got=f"no part with {ranges}", hint=hint)


def _command(part: FinishedFilm, start: int, stop: int) -> str:
    """Return the command that draws these frames into the folder of a part."""
    words = ["hsplat", "render", str(part.path)]
    if part.has_goal:
        ((name, value),) = schedule_to_dict(part.record.schedule.requested).items()
        words += ["--set", "error.tolerance=null", "--set", f"error.{name}={json.dumps(value)}"]
    template = part.file
    if not FRAME_FIELD.search(template.name):
        template = template.with_name(f"{template.stem}-{{frame:04}}{template.suffix}")
    return shlex.join([*words, "--frames", f"{start}:{stop}", "--output", str(template)])
