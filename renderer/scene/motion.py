"""Values that move: a map from frames to values gives a value at each frame.

Numbers between two keys are linear in the frame, or their logarithms are (`ratio`); vectors and lists of numbers go
component by component, and directions on the sphere. An easing changes the share of the way between two keys that is
covered at a frame. A motion is closed if its last frame leads back to the first. `smooth` is the monotone piecewise
cubic of F. N. Fritsch and J. Butland, "A method for constructing local monotone piecewise cubic interpolants", SIAM J.
Sci. Stat. Comput. 5 (1984): the velocity is continuous, and no value lies beyond its two keys; a motion that is not
closed starts and ends at rest.

In the sections of a film's scene, a `Motion` takes the place of each value that moves. Only this room reads such
sections. Other rooms have them as `OverFrames`, which gives plain values at a frame, except for a few fields whose
types name `Motion`.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from itertools import pairwise
from typing import Any, Generic, Literal, TypeVar, get_args

T = TypeVar("T")
U = TypeVar("U")

Easing = Literal["linear", "smooth", "hold", "in", "out"]
EASINGS: tuple[Easing, ...] = get_args(Easing)
MotionKind = Literal["linear", "ratio", "direction"]


# Rounding errors make a whole number smaller by less than this. It is added before such a number is rounded down.
_LEAST = 1e-9


@dataclass(frozen=True)
class Motion(Generic[T]):
    """A value that moves: its values at key frames. It is constant before the first key and after the last one.

    frames: the key frames, ascending. values: one for each key frame, all of the same shape.
    easing: how time passes between two keys. kind: how values are interpolated: `linear`, in even ratios (`ratio`), or
        on the sphere (`direction`).
    is_closed: whether the film loops, and the last key is the first key of the next loop.
    """

    frames: tuple[int, ...]
    values: tuple[T, ...]
    easing: Easing = "linear"
    kind: MotionKind = "linear"
    is_closed: bool = False

    def at(self, frame: float) -> T:
        """Return the value at a frame, exact at keys.

        Between keys, whole numbers are rounded to the nearest one or, if they move in even ratios, down.
        """
        following = bisect_right(self.frames, frame)
        if following == 0:
            return self.values[0]
        before: Any = self.values[following - 1]
        if following == len(self.frames) or frame == self.frames[following - 1] or self.easing == "hold":
            return self.values[following - 1]
        after: Any = self.values[following]
        key = following - 1
        if before == after and self.easing != "smooth":
            return self.values[key]
        x = (frame - self.frames[key]) / (self.frames[following] - self.frames[key])
        between: Any
        if self.kind == "direction":
            between = _direction_between(before, after, _eased(x, self.easing))
            return between  # type: ignore[no-any-return]
        parts = [self._part(part) for part in (key - 1, key, key + 1)]
        widths = [width for *_, width in parts]
        columns = zip(*(numbers_in(value) for *ends, _ in parts for value in ends), strict=True)
        numbers = (self._number_between(column, widths, x) for column in columns)
        between = _with_numbers(before, numbers, _LEAST if self.kind == "ratio" else 0.5)
        return between  # type: ignore[no-any-return]

    def _part(self, number: int) -> tuple[Any, Any, float]:
        """Return the values at both ends of an interval between two keys, and the interval's width in frames.

        number: the index of the interval. An interval before the first key or after the last key of a motion that is
            not closed has equal values at both ends, as the motion starts and ends at rest.
        """
        num = len(self.frames) - 1
        start, end = (number % num, number % num + 1) if self.is_closed else (max(number, 0), min(number + 1, num))
        return self.values[start], self.values[end], (self.frames[end] - self.frames[start]) or 1

    def _number_between(self, ends: Sequence[float], widths: Sequence[float], x: float) -> float:
        """Return a number at a share x of an interval between two keys.

        ends, widths: the numbers at both ends of three intervals, and the intervals' widths in frames: the interval
            before the two keys, the interval between them, and the interval after them.
        """
        pairs = list(zip(ends[::2], ends[1::2], strict=True))
        rises = [log_rise(*pair) if self.kind == "ratio" else pair[1] - pair[0] for pair in pairs]
        (start, end), way, tangents = pairs[1], _eased(x, self.easing) * rises[1], 0.0
        if self.easing == "smooth":  # cubic Hermite form, relative to the start, so that a constant stays constant
            slopes = [rise / width for rise, width in zip(rises, widths, strict=True)]
            before, after = map(_velocity, slopes, slopes[1:], widths, widths[1:])
            tangents = x * widths[1] * ((1.0 - x) ** 2 * before - x * (1.0 - x) * after)
        if self.kind != "ratio":
            return start + way + tangents
        # The ratio itself may be infinite; its root is finite.
        root = math.exp(0.5 * (way + tangents))
        return min(max(start * root * root, min(start, end)), max(start, end))


def log_rise(before: float, after: float) -> float:
    """Return the logarithm of the ratio `after / before`: 0 for equal numbers, also for two zeros."""
    if before == after:
        return 0.0
    if before == 0.0 or after == 0.0:  # such keys are at neighbouring frames, so that nothing is interpolated
        return math.copysign(math.inf, after - before)
    # Almost equal values have an exact difference; the difference of their logarithms loses digits.
    close = 0.5 * before < after < 2.0 * before
    return math.log1p((after - before) / before) if close else math.log(after) - math.log(before)


def _velocity(before: float, after: float, width_before: float, width_after: float) -> float:
    """Return the derivative of the cubic curve of Fritsch and Butland at a key.

    It is a weighted harmonic mean of the slopes of the intervals before and after the key, or 0 if one of them rises
    and the other falls. width_before, width_after: the widths of the intervals, in frames.
    """
    product = before * after
    if not 0.0 < product < math.inf:
        return 0.0
    weight_before, weight_after = width_before + 2.0 * width_after, 2.0 * width_before + width_after
    # A quotient of products, without the reciprocal of a slope that is almost 0.
    return (weight_before + weight_after) * product / (weight_before * after + weight_after * before)


def _eased(x: float, easing: Easing) -> float:
    """Return the share of the way from one key to the next at a share `x` of the time. Both shares are in [0, 1]."""
    if easing == "smooth":
        return x * x * (3.0 - 2.0 * x)
    if easing == "in":
        return x * x
    return x * (2.0 - x) if easing == "out" else x


def _direction_between(before: Sequence[float], after: Sequence[float], x: float) -> tuple[float, ...]:
    """Return the unit vector at a share `x` of the great circle from one direction to another.

    Between opposite directions, an arbitrary great circle is taken.
    """
    start, end = _unit(before), _unit(after)
    cosine = sum(a * b for a, b in zip(start, end, strict=True))
    aside = [b - cosine * a for a, b in zip(start, end, strict=True)]
    sine = math.hypot(*aside)
    if sine < 1e-9:
        if cosine > 0.0:
            return start
        least = min(range(3), key=lambda axis: abs(start[axis]))
        aside = [(axis == least) - start[least] * part for axis, part in enumerate(start)]
    angle, aside_unit = x * math.atan2(sine, cosine), _unit(aside)
    return _unit([math.cos(angle) * a + math.sin(angle) * b for a, b in zip(start, aside_unit, strict=True)])


def _unit(vector: Sequence[float]) -> tuple[float, ...]:
    length = math.hypot(*vector)
    return tuple(part / length for part in vector)


# Numbers inside of values, such as those of a colour or a control point


def numbers_in(value: object) -> Iterator[float]:
    """Yield all numbers in a value, also those inside of tuples and dataclasses."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        yield value
    for part in _parts(value):
        yield from numbers_in(part)


def shape_of(value: object) -> object:
    """Return the shape of a value: two values have the same shape if they differ only in numbers."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return "number"
    parts = _parts(value)
    return (type(value), *map(shape_of, parts)) if parts else value


def _with_numbers(value: Any, numbers: Iterator[float], half: float) -> Any:
    """Return a value with `numbers` in the place of its numbers.

    A number that takes the place of a whole one is made whole: `half` is added to it, and the sum is rounded down.
    """
    if isinstance(value, bool):
        return value
    if isinstance(value, int):
        return math.floor(next(numbers) + half)
    if isinstance(value, float):
        return next(numbers)
    return _with_parts(value, [_with_numbers(part, numbers, half) for part in _parts(value)])


def _parts(value: object) -> Sequence[object]:
    if isinstance(value, tuple):
        return value
    return [getattr(value, each.name) for each in fields(value) if each.init] if is_dataclass(value) else ()


def _with_parts(value: Any, parts: Sequence[object]) -> Any:
    if all(new is old for new, old in zip(parts, _parts(value), strict=True)):
        return value
    if isinstance(value, tuple):
        return tuple(parts)
    names = [each.name for each in fields(value) if each.init]
    return replace(value, **dict(zip(names, parts, strict=True)))


# Parts of a scene whose values move


@dataclass(frozen=True)
class OverFrames(Generic[T]):
    """A part of a scene over all frames of its film. Its values may move, so that it has to be read at a frame.

    _value: the part, with a motion in place of each value that moves. No other room reads it.
    """

    _value: T

    def at(self, frame: float) -> T:
        """Return the part at a frame, with plain values."""
        return values_at(self._value, frame)

    def map(self, function: Callable[[T], U]) -> OverFrames[U]:
        """Return a part over all frames that a function makes of this part, by picking or replacing something.

        The function must not calculate with values, as they may be motions.
        """
        return OverFrames(function(self._value))

    @property
    def motions(self) -> list[Motion[Any]]:
        """Return the motions of all values that move."""
        return list(motions_in(self._value))

    @property
    def moves(self) -> bool:
        """Return whether any value moves."""
        return any(motions_in(self._value))

    @property
    def key_frames(self) -> list[int]:
        """Return the frames at which a motion has a key, ascending."""
        return sorted({frame for motion in motions_in(self._value) for frame in motion.frames})

    @property
    def changing_frames(self) -> list[tuple[int, int]]:
        """Return ranges of frames, as (first, last), on which some value differs from its value one frame before."""
        found = {
            frame
            for motion in motions_in(self._value)
            for (start, before), (end, after) in pairwise(zip(motion.frames, motion.values, strict=True))
            if before != after
            for frame in range(start + 1, end + 1)
        }
        starts, ends = (sorted(frame for frame in found if frame + step not in found) for step in (-1, 1))
        return list(zip(starts, ends, strict=True))


def value_at(value: T | Motion[T], frame: float) -> T:
    """Return the value of a motion at a frame; return a value that is no motion unchanged."""
    return value.at(frame) if isinstance(value, Motion) else value


def motion_to_dict(motion: Motion[Any], plain: Callable[[Any], Any]) -> dict[Any, Any]:
    """Return a motion as a map from frames to values. plain: a function that makes plain data of a value."""
    by_frame = {frame: plain(value) for frame, value in zip(motion.frames, motion.values, strict=True)}
    return by_frame | ({"easing": motion.easing} if motion.easing != "linear" else {})


def moving(motion: Motion[Any]) -> Any:
    """Return a motion, or its value if it has the same value at all keys."""
    first = motion.values[0]
    return first if all(value == first for value in motion.values) else motion


def motions_in(value: object) -> Iterator[Motion[Any]]:
    """Yield all motions in a part of a scene."""
    if isinstance(value, Motion):
        yield value
        return
    for part in _parts(value):
        yield from motions_in(part)


def is_plain(*values: object) -> bool:
    """Return whether none of the values is a motion or contains one."""
    return not any(motions_in(values))


def values_at(value: T, frame: float) -> T:
    """Return a part of a scene at a frame, with plain values in place of motions; the same object if nothing moves."""
    if isinstance(value, Motion):
        plain: T = value.at(frame)
        return plain
    parts = _parts(value)
    made: T = _with_parts(value, [values_at(part, frame) for part in parts]) if parts else value
    return made


def at_keys(function: Callable[[Any], Any], value: Any) -> Any:
    """Return the result of a function for a plain value; for a motion, the motion of the results at its keys."""
    if not isinstance(value, Motion):
        return function(value)
    values = tuple(map(function, value.values))
    return moving(Motion(value.frames, values, value.easing, value.kind, value.is_closed))


def moving_result(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the result of a function for arguments that may move: a motion if any of them does.

    The function must be affine in each argument, so that the result is right between keys, too.
    """
    found = list(motions_in(arguments))
    if not found:
        return function(*arguments)
    motion, frames = found[0], sorted({frame for each in found for frame in each.frames})
    if len(found) > 1:  # a product of two motions is not affine in the frame, so each frame is a key
        motion, frames = Motion((), ()), list(range(frames[0], frames[-1] + 1))
    made = tuple(function(*values_at(arguments, frame)) for frame in frames)
    return moving(Motion(tuple(frames), made, motion.easing, motion.kind, motion.is_closed))
