"""Defines pairs of frames and the outcomes of comparing them, and formats errors and limits."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from hsplat_cli.compare.frame_difference import COMPARISON_METRICS, FrameDifference
from hsplat_cli.compare.strictness import Limits, exceeded_limits, severity
from renderer.errors import InputError
from renderer.film import Pixels
from renderer.scene import counted, format_value

# `same`: the pixels are equal. `close`: the errors are within the limits. A frame of any other status fails.
Status = Literal["same", "close", "different", "missing", "extra", "other size", "other channels"]
_PASSES = ("same", "close")
# The statuses in the words and in the order of summaries.
_WORDS: dict[Status, str] = {
    "different": "different",
    "missing": "missing",
    "extra": "not among the goldens",
    "other size": "of another size",
    "other channels": "with other channels",
    "same": "the same",
    "close": "close",
}
# Names of the kinds of pictures, by their number of channels.
_KINDS = {3: "RGB", 4: "RGBA"}


@dataclass(frozen=True)
class Pair:
    """Holds a golden frame and the actual one: uint8 [h, w, 3 or 4], straight alpha; None for a side without the frame.

    name: the name of the file, or `frame 12` of a film. is_recorded: whether golden.json lists the golden; then a
    golden of None means that its file is missing.
    """

    name: str
    golden: Pixels | None
    actual: Pixels | None
    is_recorded: bool = False


@dataclass(frozen=True)
class Pairs:
    """Holds all pairs of a comparison, read one at a time, in the order of `names`.

    Iterating over `pairs` raises InputError if a frame cannot be read. notes: notes for the user. facts: the values
    (golden, actual) of each fact that may differ, such as the device, by its name.
    """

    names: Sequence[str]
    pairs: Iterator[Pair]
    notes: Sequence[str] = ()
    facts: Mapping[str, tuple[str, str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """Holds the outcome of one pair of frames.

    name: the name of the pair. status: one of the words of `Status`. why: the reason in one sentence; every number in
    it has its metric, its unit and its limit. limits: the limits of this frame. figures: errors by the names of
    COMPARISON_METRICS; empty if nothing can be compared. exceeded: the names of the metrics that exceed their limits;
    the first is the reason. bias: mean signed error of each channel, in grey steps, actual minus golden.
    """

    name: str
    status: Status
    why: str
    limits: Limits = field(default_factory=dict)
    figures: Mapping[str, float] = field(default_factory=dict)
    exceeded: Sequence[str] = ()
    bias: Sequence[float] = ()

    @property
    def passes(self) -> bool:
        """Return whether the frame is within its limits."""
        return self.status in _PASSES

    @property
    def severity(self) -> float:
        """Return the largest error as a multiple of its limit; infinite if the pictures cannot be compared."""
        is_comparable = self.passes or self.status == "different"
        return severity(self.figures, self.limits) if is_comparable else math.inf

    @property
    def rank(self) -> tuple[bool, float]:
        """Return a sort key, worst first: failing frames before passing ones, then by severity."""
        return (self.passes, -self.severity)


@dataclass(frozen=True)
class Comparison:
    """Holds the outcomes of all pairs, at least one, in the order of their names.

    golden, actual: descriptions of both sides. level: a key of STRICTNESSES. notes: notes for the user. facts: the
    values (golden, actual) of each fact that may differ, such as the device, by its name. other_limits: texts on the
    limits that differ from the limits of the level.
    """

    golden: str
    actual: str
    level: str
    outcomes: Sequence[Outcome]
    notes: Sequence[str] = ()
    facts: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    other_limits: Sequence[str] = ()

    @property
    def strictness(self) -> str:
        """Return the name of the level, followed by the limits that replace limits of the level."""
        return f"{self.level} (with other limits: {'; '.join(self.other_limits)})" if self.other_limits else self.level

    @property
    def num_failing(self) -> int:
        """Return the number of frames that fail."""
        return sum(not outcome.passes for outcome in self.outcomes)

    @property
    def passes(self) -> bool:
        """Return whether every frame passes."""
        return self.num_failing == 0

    @cached_property
    def counts(self) -> Mapping[str, int]:
        """Return the number of outcomes of each status."""
        return Counter(outcome.status for outcome in self.outcomes)

    @property
    def summary(self) -> str:
        """Return the verdict in one line: `3 of 48 frames fail: 2 different, 1 missing, 45 the same`."""
        num, num_failing = len(self.outcomes), self.num_failing
        parts = ", ".join(f"{self.counts[status]} {words}" for status, words in _WORDS.items() if self.counts[status])
        if num_failing:
            return f"{num_failing} of {counted(num, 'frame')} {'fails' if num_failing == 1 else 'fail'}: {parts}"
        return f"{counted(num, 'frame')} {'passes' if num == 1 else 'pass'} at {self.strictness}: {parts}"

    @property
    def worst_first(self) -> list[Outcome]:
        """Return the outcomes sorted by `Outcome.rank`, then in the order of their names."""
        return sorted(self.outcomes, key=lambda outcome: outcome.rank)

    @cached_property
    def frame_numbers(self) -> Mapping[str, int]:
        """Return the last number in each frame's name; empty if the names differ in more than this number."""
        names = [outcome.name for outcome in self.outcomes]
        found = {name: re.split("([0-9]{1,18})", name) for name in names}
        patterns = {(*parts[:-2], parts[-1]) if len(parts) > 1 else None for parts in found.values()}
        numbers = {name: int(parts[-2]) for name, parts in found.items() if len(parts) > 1}
        return numbers if len(patterns) == 1 and len(set(numbers.values())) == len(names) else {}


def compare_pair(pair: Pair, limits: Limits) -> Outcome:
    """Compare one pair. Raises InputError if a limited metric cannot be computed."""
    golden, actual = pair.golden, pair.actual
    if golden is None or actual is None:
        status: Status = "missing" if actual is None or pair.is_recorded else "extra"
        return Outcome(pair.name, status, f"{'ACTUAL' if actual is None else 'GOLDEN'} has no such frame", limits)
    (height, width, channels), (actual_height, actual_width, actual_channels) = golden.shape, actual.shape
    if (height, width) != (actual_height, actual_width):
        why = f"{actual_width} x {actual_height} pixels, the golden has {width} x {height}"
        return Outcome(pair.name, "other size", why, limits)
    if channels != actual_channels:
        change = "lost" if channels == 4 else "new"
        why = f"{_KINDS[actual_channels]}, the golden is {_KINDS[channels]}: alpha is {change}"
        return Outcome(pair.name, "other channels", why, limits)
    if golden is actual or np.array_equal(golden, actual):
        figures = {name: float(COMPARISON_METRICS[name].higher_is_better) for name in limits}
        return Outcome(pair.name, "same", "the same pixels", limits, figures, bias=(0.0,) * channels)
    return _compare_pixels(pair.name, FrameDifference(golden, actual), limits)


def _compare_pixels(frame: str, difference: FrameDifference, limits: Limits) -> Outcome:
    figures = difference.metrics(limits)
    for name in limits:
        if name not in figures:
            hint = f"remove the limit for this frame: {name}: none"
            raise InputError(f"too small a picture for {COMPARISON_METRICS[name].label}", where=frame, hint=hint)
    exceeded = exceeded_limits(figures, limits)
    worst = exceeded[0] if exceeded else max(limits, key=lambda name: severity(figures, {name: limits[name]}))
    why = figure_text(worst, figures[worst], limits[worst])
    if difference.largest() == 0:
        why = "the same picture: only colours at an alpha of 0 differ"
    elif not exceeded:
        why = f"within the limits; the closest is {why}"
    status: Status = "different" if exceeded else "close"
    return Outcome(frame, status, why, limits, figures, exceeded, difference.bias)


# Numbers in messages and reports


def figure_text(name: str, value: float, limit: float) -> str:
    """Format a metric: `largest error of a channel 7 steps, at most 1`."""
    amount = _with_unit(name, value_text(name, value, limit))
    return f"{COMPARISON_METRICS[name].label} {amount}, {limit_text(name, limit)}"


def value_text(name: str, value: float, limit: float) -> str:
    """Format a value with three digits, or with enough to show on which side of its limit it is."""
    passes = COMPARISON_METRICS[name].passes
    texts = (f"{value:.{num_digits}g}" for num_digits in range(3, 18))
    return next(text for text in texts if passes(float(text), limit) == passes(value, limit))


def limit_text(name: str, limit: float) -> str:
    """Format a limit: `at most 4`, `at least 0.99`."""
    return f"{'at least' if COMPARISON_METRICS[name].higher_is_better else 'at most'} {format_value(limit)}"


def limits_text(name: str, limits: Iterable[float]) -> str:
    """Name a metric and its limit, if all frames share it: `largest error of a channel, at most 4 steps`."""
    first, *others = sorted(set(limits))
    if others:
        return f"{COMPARISON_METRICS[name].label}, limits differ between frames"
    return f"{COMPARISON_METRICS[name].label}, {_with_unit(name, limit_text(name, first))}"


def signed_text(value: float) -> str:
    """Format a signed number, with a true minus sign: `+0.12`, `−3`, `0`."""
    return f"{value:+.3g}".replace("-", "−") if value else "0"


def share_text(share: float) -> str:
    """Format an error as a multiple of its limit: `0.25`, `12.3`, `∞`."""
    return "∞" if math.isinf(share) else f"{share:.3g}"


def _with_unit(name: str, text: str) -> str:
    """Return a text that ends with a number, followed by the metric's unit: `1 step`, `at most 4 steps`."""
    unit = COMPARISON_METRICS[name].unit
    return f"{text} {unit.removesuffix('s') if f' {text}'.endswith(' 1') else unit}".rstrip()
