"""`--frames a:b:step`: which frames of a film."""

from __future__ import annotations

from renderer.errors import InputError
from renderer.schema import show


def parse_frames(text: str | None, num_frames: int) -> range:
    """The frames that `a:b:step`, a Python slice, or a single number picks from range(num_frames); all for None.

    Raises InputError where it is not a slice, has a step below 1, or picks nothing.
    """
    if text is None:
        return range(num_frames)
    expected = f"A:B or A:B:STEP or one number; this path has the frames 0 to {num_frames - 1}"
    try:
        parts = [int(part) if part.strip() else None for part in text.split(":")]
    except ValueError:
        parts = []
    if not 1 <= len(parts) <= 3 or parts == [None]:
        raise InputError("not a range of frames", where="--frames", got=show(text), expected=expected)
    if len(parts) == 1 and parts[0] is not None:
        number = parts[0]
        picked = range(num_frames)[number : number + 1] if 0 <= number < num_frames else range(0)
    else:
        step = parts[2] if len(parts) == 3 else None
        if step is not None and step < 1:
            raise InputError("frames go forward", where="--frames", got=show(text), expected="a step of at least 1")
        picked = range(num_frames)[slice(*parts)]
    if not picked:
        raise InputError("no frame is in this range", where="--frames", got=show(text), expected=expected)
    return picked
