"""Reads values of the command line: output paths, durations (`90s`), memory (`2GB`), frames (`--frames A:B:STEP`)."""

from __future__ import annotations

import inspect
import os
import re
from collections.abc import Callable, Sequence
from functools import partial, wraps
from pathlib import Path
from typing import TypeVar

import click

from renderer.errors import InputError
from renderer.scene import TILDE_HINT, format_value, has_unexpanded_tilde, path_or_url

# The type of a command while it is declared: a function, or the click command that was made of the function.
Command = TypeVar("Command", bound="Callable[..., object] | click.Command")
_Function = Callable[..., None]
_NUMBER = r"(\d+(?:\.\d*)?)"
_FRACTION_ONLY_IN_LAST_PART = r"(?!.*\..*[hms].)"
_PARTS = f"(?=.)(?:{_NUMBER}h)?(?:{_NUMBER}m)?(?:{_NUMBER}s)?"
_DURATION = re.compile(f"{_FRACTION_ONLY_IN_LAST_PART}{_PARTS}|{_NUMBER}", re.ASCII)
# The largest number of characters of a duration for each of its three parts: hours, minutes and seconds.
_MOST_DIGITS = 9
_BYTES = re.compile(r"(\d{1,15}(?:\.\d{1,9})?) ?([KMGT]?)(i?)B?", re.ASCII | re.IGNORECASE)

_FRAMES_EXPECTED = "A:B or A:B:STEP, without frame B (30:41 for frames 30 to 40), or one number"
# Matches a range of frames as `30-40`, which `--frames` does not take.
_RANGE = re.compile(r"(\d{1,9}) *(?:-|–|\.\.) *(\d{1,9})", re.ASCII)

# For options of `init` and `turntable`, by which a scene is suggested: the key of the scene with an example of a value.
_SETTINGS = {
    "--size": "'output.size=[512, 512]'",
    "--fps": "output.frames_per_second=30",
    "--background": "output.background=white",
    "--light": "'light={environment: studio}'",
    "--elevation": "camera.path.elevation=20",
    "--tolerance": "error.tolerance=0.1",
}


def option_group(*options: Callable[[Command], Command]) -> Callable[[Command], Command]:
    """Return a decorator that declares several click options, in this order."""

    def declare(command: Command) -> Command:
        for option in reversed(options):
            command = option(command)
        return command

    return declare


def set_hint(command: click.Command, option: str) -> str | None:
    """Return a `--set` that does what an option of `init` does; None without such a key, or without `--set`."""
    has_set = any("--set" in parameter.opts for parameter in command.params)
    return f"--set {_SETTINGS[option]}" if has_set and option in _SETTINGS else None


def packed_options(
    name: str, cls: Callable[..., object], *options: Callable[[_Function], _Function]
) -> Callable[[_Function], _Function]:
    """Return a decorator that declares click options, and hands their values to the command as one object.

    name: the command's parameter for the object. cls: the object's class, whose parameters have the options' names.
    """
    names = inspect.signature(cls).parameters

    def declare(command: _Function) -> _Function:
        @wraps(command)
        def with_object(*arguments: object, **values: object) -> None:
            packed = cls(**{each: values.pop(each) for each in names})
            command(*arguments, **{name: packed}, **values)

        return option_group(*options)(with_object)

    return declare


class OutputPath(click.Path):
    """Reads an output path, and refuses a leading `~`, which shells keep in `--output=~/films`.

    dir_okay: whether the path may be a folder. If not, `scene.yaml/` is refused, too; click alone drops the slash.
    """

    def __init__(self, *, file_okay: bool = True, dir_okay: bool = True) -> None:
        super().__init__(path_type=Path, file_okay=file_okay, readable=False)
        self._may_be_folder = dir_okay

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | os.PathLike[str]:
        """Return the path. Raises InputError for a path in a folder `~`, and for a folder in place of a file."""
        name = "" if param is None else max(param.opts, key=len)
        where = name if name.startswith("-") else name.upper()
        if has_unexpanded_tilde(str(value)):
            raise InputError("a folder named ~", where=where, got=str(value), hint=TILDE_HINT)
        if not self._may_be_folder and os.path.basename(str(value)) in ("", ".", ".."):
            raise InputError("the output is a folder", where=where, got=str(value), expected="the name of a file")
        return super().convert(value, param, ctx)


class VolumePath(click.Path):
    """Reads the path of a volume, which need not exist, or the URL of a store, which stays a text.

    click does not check that a file exists, because its messages differ from hsplat's.
    """

    def __init__(self) -> None:
        super().__init__(path_type=Path, readable=False)

    def convert(
        self, value: str | os.PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | os.PathLike[str]:
        """Return the path, or the URL."""
        place = path_or_url(os.fspath(value))
        return place if isinstance(place, str) else super().convert(value, param, ctx)


def parse_duration(text: str, *, where: str) -> float:
    """Return the seconds in `90`, `90s`, `1.5m` or `1h30m`.

    A number without a unit stands alone; only the last part may have a fraction. Raises InputError for other text, and
    for 0 seconds.
    """
    match = _DURATION.fullmatch(text.strip()) if len(text) <= 3 * _MOST_DIGITS else None
    expected = "a time such as 90s, 10m or 1h30m"
    if match is None:
        raise InputError("not a duration", where=where, got=format_value(text), expected=expected)
    hours, minutes, seconds, bare = (float(part or 0) for part in match.groups())
    total = 3600 * hours + 60 * minutes + seconds + bare
    if total == 0:
        raise InputError("a duration of 0", where=where, got=format_value(text), expected=f"{expected}, more than 0")
    return total


def parse_bytes(text: str, *, where: str) -> int:
    """Return the bytes in `2GB`, `1.5 GiB`, `512M` or `1000000`. Raises InputError for other text, and for 0 bytes."""
    match, expected = _BYTES.fullmatch(text.strip()), "an amount such as 512MB, 2GB or 1.5GiB"
    if match is None:
        raise InputError("not an amount of memory", where=where, got=format_value(text), expected=expected)
    number, prefix, binary = match.groups()
    found = int(float(number) * (1024 if binary else 1000) ** " KMGT".index(prefix.upper() or " "))
    if found == 0:
        raise InputError("no memory", where=where, got=format_value(text), expected=f"{expected}, more than 0")
    return found


def is_one_frame(text: str | None) -> bool:
    """Return whether a value of --frames picks at most one frame in a film of any length: `7`, `7:8`."""
    if text is None or ":" not in text:  # `-1` included: every film has a last frame
        return text is not None
    match _parts(text):
        case [int(start), int(stop)] | [int(start), int(stop), None | 1]:
            return start >= 0 and stop - start == 1
    return False


def parse_frames(text: str | None, num_frames: int, recorded: Sequence[int] | None = None) -> Sequence[int]:
    """Return the frames that the value of --frames, a slice `a:b:step` or a number, picks from range(num_frames).

    Negative numbers count from the end. None picks all frames. recorded: the frames that a film has, ascending; None if
    there is no film.

    Raises InputError for text that is not a slice, has a step below 1, picks nothing, or picks a frame that is not
    recorded.
    """
    if text is None:
        return range(num_frames) if recorded is None else recorded
    expected = f"{_FRAMES_EXPECTED}; this path has the frames 0 to {num_frames - 1}"
    error = partial(InputError, where="--frames", got=format_value(text))
    match _parts(text):
        case [int(number)]:
            picked = range(num_frames)[number : number + 1 or None]
        case [_, _, int(step)] if step < 1:
            raise error("frames go forward", expected="a step of at least 1")
        case [_, _] | [_, _, _] as parts:
            picked = range(num_frames)[slice(*parts)]
        case _:
            raise error("not a range of frames", expected=expected, hint=_as_range(text))
    if not picked:
        raise error("no frame is in this range", expected=expected)
    missing = set(picked).difference(picked if recorded is None else recorded)
    if recorded is not None and missing:
        raise error(f"frame {min(missing)} is not in the film", expected=f"frames of {_as_slice(recorded)}")
    return picked


def _parts(text: str) -> list[int | None]:
    """Return the numbers between the colons, with None for an empty part; an empty list if a part is not a number."""
    try:
        return [int(part) if part.strip() else None for part in text.split(":")]
    except ValueError:
        return []


def _as_range(text: str) -> str | None:
    """Return a hint with the slice for a range such as `30-40`; None for other text."""
    match = _RANGE.fullmatch(text.strip())
    if match is None:
        return None
    first, last = sorted(map(int, match.groups()))
    return f"--frames {first}:{last + 1} for frames {first} to {last}"


def _as_slice(frames: Sequence[int]) -> str:
    """Return frames as a slice such as `0:118:3`, or as a list where no slice picks exactly these frames."""
    step = frames[1] - frames[0] if len(frames) > 1 else 1
    steady = range(frames[0], frames[-1] + 1, step)
    if list(steady) != list(frames):
        return format_value(frames)
    return ":".join(map(str, (steady.start, steady.stop, step)[: 3 if step > 1 else 2]))
