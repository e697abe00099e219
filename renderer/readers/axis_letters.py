"""Say which axes of an array are of times, of components and of space, by their kinds and by their number."""

from __future__ import annotations

from collections.abc import Sequence

from renderer.errors import InputError
from renderer.readers.numpy_arrays import axes_of_array
from renderer.scene import short_text
from renderer.stores import Axis


def letters_of(axes: Sequence[Axis], lengths: Sequence[int], time: int | None, component: int | None) -> str:
    """Return a letter for each axis: `t` for time, `c` for components, `s` for space, `-` for an axis left out.

    axes, lengths: from the slowest axis to the fastest. time, component: the scene's choice, None without one.
    If more than three axes are not of times or components, axes of length 1 are left out; if there are still more than
    three, the rule for `.npy` files says which are times and components. With fewer than three axes in space, an axis
    of times or components becomes one of space. Raises InputError for axes that are not those of a volume.
    """
    letters = [{"time": "t", "channel": "c"}.get(axis.kind, "s") for axis in axes]
    for k, length in enumerate(lengths):
        if letters.count("s") > 3 and letters[k] == "s" and length == 1:
            letters[k] = "-"
    while letters.count("s") < 3 and {"t", "c"} & {*letters}:
        letters[letters.index("t" if "t" in letters else "c")] = "s"
    if letters.count("s") > 3:
        shape = tuple(length for length, letter in zip(lengths, letters, strict=True) if letter == "s")
        others = iter(axes_of_array(shape, None if "t" in letters else time, None if "c" in letters else component))
        letters = [next(others) if letter == "s" else letter for letter in letters]
    if letters.count("t") > 1 or letters.count("c") > 1:
        raise InputError(
            "the axes of this dataset are not those of a volume",
            got=", ".join(f"{short_text(axis.name) or 'no name'} ({length})"
                          for axis, length in zip(axes, lengths, strict=True)),
            expected="three axes in space, at most one of time, and at most one of components",
        )  # fmt: skip
    return "".join(letters)
