"""How far the work is: a bar on a terminal, a line now and then elsewhere, on the standard error stream."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TextIO

if TYPE_CHECKING:
    from tqdm import tqdm

# A line is due after this part of the work or this time, whichever comes first, but never sooner than the least time:
# a short film prints a few lines, a long one does not look dead, and neither floods a log.
_LINE_EVERY_FRACTION = 0.1
_MAX_LINE_INTERVAL_S = 60.0
_MIN_LINE_INTERVAL_S = 2.0

# Of work of unequal steps the bar shows the part that is done; a number of steps a second would mean nothing.
_WEIGHTED_BAR_FORMAT = "{desc}: {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}{postfix}]"


class Progress(Protocol):
    """Counts finished steps."""

    def advance(self, note: str = "") -> None:
        """One step more is done; `note` is a few words about it."""


@contextlib.contextmanager
def progress(steps: int | Sequence[float], *, label: str, quiet: bool, unit: str = "frames") -> Iterator[Progress]:
    """Show how many of the steps are done and the time remaining; nothing when `quiet`.

    steps: the number of steps of equal cost, with which their rate is shown too, or the predicted work of each step,
        not negative and in any unit, by which the time remaining is told. unit: what a step is, in the plural.
    """
    if quiet:
        yield _SilentProgress()
    elif sys.stderr.isatty():
        # Imported only where a bar is drawn: a plain log does not need it.
        from tqdm import tqdm

        if isinstance(steps, int):
            with tqdm(total=steps, desc=label, unit=f" {unit}", file=sys.stderr, dynamic_ncols=True) as bar:
                yield _Bar(bar)
        else:
            # Without smoothing: the rate of the last steps tells little where each is of another kind.
            with tqdm(
                total=sum(steps), bar_format=_WEIGHTED_BAR_FORMAT, smoothing=0, file=sys.stderr, dynamic_ncols=True
            ) as bar:
                yield _WeightedBar(bar, steps, label, unit)
    else:
        yield Lines(steps, label, sys.stderr, time.monotonic, unit)


class _SilentProgress:
    def advance(self, note: str = "") -> None:
        pass


class _Bar:
    def __init__(self, bar: tqdm[Any]) -> None:
        self._bar = bar

    def advance(self, note: str = "") -> None:
        self._bar.set_postfix_str(note, refresh=False)
        self._bar.update()


class _WeightedBar:
    def __init__(self, bar: tqdm[Any], work: Sequence[float], label: str, unit: str) -> None:
        self._bar, self._work, self._label, self._unit = bar, work, label, unit
        self._done = 0
        self._describe()

    def advance(self, note: str = "") -> None:
        self._done += 1
        self._bar.set_postfix_str(note, refresh=False)
        self._bar.update(self._work[self._done - 1])
        self._describe()

    def _describe(self) -> None:
        self._bar.set_description_str(f"{self._label} {self._done}/{len(self._work)} {self._unit}")


class Lines:
    """Progress as lines of text; `clock` gives seconds, the rest is as in `progress`."""

    def __init__(
        self,
        steps: int | Sequence[float],
        label: str,
        stream: TextIO,
        clock: Callable[[], float],
        unit: str = "frames",
    ) -> None:
        self._has_rate = isinstance(steps, int)
        self._work = [1.0] * steps if isinstance(steps, int) else list(steps)
        self._label, self._stream, self._clock, self._unit = label, stream, clock, unit
        self._total_work = sum(self._work)
        self._done, self._done_work, self._work_at_line = 0, 0.0, 0.0
        self._start = self._time_of_line = clock()
        self._first = (self._start, 0.0)  # when the first step was done, and its work

    def advance(self, note: str = "") -> None:
        """One step more is done: a line, if one is due."""
        self._done_work += self._work[self._done]
        self._done += 1
        now = self._clock()
        if self._done == 1:
            self._first = (now, self._done_work)
        if not self._is_due(now):
            return
        self._work_at_line, self._time_of_line = self._done_work, now
        print(f"{self._label}: {', '.join(self._parts(now, note))}", file=self._stream, flush=True)

    def _parts(self, now: float, note: str) -> Iterator[str]:
        yield f"{self._done}/{len(self._work)} {self._unit}"
        if self._has_rate:
            yield f"{self._done / max(now - self._start, 1e-9):.2f} {self._unit}/s"
        # The first step takes what the start does, too: by the later ones, as soon as there are some.
        since, before = self._first if self._done_work > self._first[1] else (self._start, 0.0)
        if self._done < len(self._work) and self._done_work > before:
            left = (now - since) * (self._total_work - self._done_work) / (self._done_work - before)
            yield f"{duration(left)} left"
        if note:
            yield note

    def _is_due(self, now: float) -> bool:
        if self._done == len(self._work):
            return True
        waited = now - self._time_of_line
        part = (self._done_work - self._work_at_line) / max(self._total_work, 1e-9)
        return waited >= _MIN_LINE_INTERVAL_S and (part >= _LINE_EVERY_FRACTION or waited >= _MAX_LINE_INTERVAL_S)


def duration(seconds: float) -> str:
    """`0:07`, `12:34` or `1:02:03`."""
    minutes, whole_seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{whole_seconds:02}" if hours else f"{minutes}:{whole_seconds:02}"
