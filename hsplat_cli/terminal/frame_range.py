"""Reads `--frames A:B:STEP`, which picks frames of a film."""

from __future__ import annotations

from collections.abc import Sequence

from renderer.errors import InputError
from renderer.scene import format_value


def is_one_frame(text: str | None) -> bool:
    """Return whether this picks at most one frame, however long the path is: `7`, `7:8`."""
    if text is None or ":" not in text:  # also `-1`, the last one, which every path has
        return text is not None
    match _parts(text):
        case [int(start), int(stop)] | [int(start), int(stop), None | 1]:
            return start >= 0 and stop - start == 1
    return False


def parse_frames(text: str | None, num_frames: int, recorded: Sequence[int] | None = None) -> Sequence[int]:
    """Return the frames that a Python slice `a:b:step` or a number picks from range(num_frames); all for None.

    Negative numbers count from the end. recorded: the frames that a film has, ascending.

    Raises InputError for what is not a slice, has a step below 1, picks nothing, or picks a frame that is not recorded.
    """
    if text is None:
        return range(num_frames) if recorded is None else recorded
    expected = f"A:B or A:B:STEP or one number; this path has the frames 0 to {num_frames - 1}"
    parts = _parts(text)
    if not 1 <= len(parts) <= 3 or parts == [None]:
        raise InputError("not a range of frames", where="--frames", got=format_value(text), expected=expected)
    if len(parts) == 1 and parts[0] is not None:
        number = parts[0]
        is_there = -num_frames <= number < num_frames
        picked = range(num_frames)[number : number + 1 or None] if is_there else range(0)
    else:
        step = parts[2] if len(parts) == 3 else None
        if step is not None and step < 1:
            raise InputError(
                "frames go forward", where="--frames", got=format_value(text), expected="a step of at least 1"
            )
        picked = range(num_frames)[slice(*parts)]
    if not picked:
        raise InputError("no frame is in this range", where="--frames", got=format_value(text), expected=expected)
    missing = next(iter(sorted({*picked}.difference(picked if recorded is None else recorded))), None)
    if recorded is not None and missing is not None:
        raise InputError(
            f"frame {missing} is not in the film",
            where="--frames",
            got=format_value(text),
            expected=f"frames of {_as_slice(recorded)}",
        )
    return picked


def _parts(text: str) -> list[int | None]:
    """Return the numbers between the colons, None for those left out; nothing where one is not a number."""
    try:
        return [int(part) if part.strip() else None for part in text.split(":")]
    except ValueError:
        return []


def _as_slice(frames: Sequence[int]) -> str:
    """Return `0:118:3`, or a list where no slice gives these frames."""
    step = frames[1] - frames[0] if len(frames) > 1 else 1
    steady = range(frames[0], frames[-1] + 1, step)
    if len(steady) != len(frames) or any(a != b for a, b in zip(steady, frames, strict=True)):
        return format_value(frames)
    return ":".join(map(str, (steady.start, steady.stop, step)[: 3 if step > 1 else 2]))
