"""Reads `--frames A:B:STEP`, which picks frames of a film."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

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
    error = partial(InputError, where="--frames", got=format_value(text))
    match _parts(text):
        case [int(number)]:
            picked = range(num_frames)[number : number + 1 or None]
        case [_, _, int(step)] if step < 1:
            raise error("frames go forward", expected="a step of at least 1")
        case [_, _] | [_, _, _] as parts:
            picked = range(num_frames)[slice(*parts)]
        case _:
            raise error("not a range of frames", expected=expected)
    if not picked:
        raise error("no frame is in this range", expected=expected)
    missing = set(picked).difference(picked if recorded is None else recorded)
    if recorded is not None and missing:
        raise error(f"frame {min(missing)} is not in the film", expected=f"frames of {_as_slice(recorded)}")
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
    if list(steady) != list(frames):
        return format_value(frames)
    return ":".join(map(str, (steady.start, steady.stop, step)[: 3 if step > 1 else 2]))
