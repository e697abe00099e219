"""Shows how far the work is, on the standard error stream: a bar on a terminal, elsewhere a line now and then."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from tqdm import tqdm

# A line is due after this part of the work or this time, whichever comes first, but never sooner than the least time:
# a short film prints a few lines, a long one does not look dead, and neither floods a log.
_LINE_EVERY_FRACTION = 0.1
_MAX_LINE_INTERVAL_S = 60.0
_MIN_LINE_INTERVAL_S = 2.0

# With steps of unequal work, steps per second would mean nothing.
_WEIGHTED_BAR_FORMAT = "{desc}: {percentage:3.0f}%|{bar}| [{elapsed}<{remaining}{postfix}]"


class Progress:
    """Counts finished steps; this one shows nothing."""

    def advance(self, note: str = "") -> None:
        """Count one step more. note: a few words about it."""


@contextlib.contextmanager
def open_progress(steps: int | Sequence[float], *, label: str, unit: str, is_quiet: bool) -> Iterator[Progress]:
    """Show progress on the standard error stream, or nothing when quiet; the rest is as in `Reporter.progress`."""
    if is_quiet:
        yield Progress()
    elif not sys.stderr.isatty():
        yield ProgressLines(steps, label, sys.stderr, time.monotonic, unit)
    else:
        # Imported only where a bar is drawn: a plain log does not need it.
        from tqdm import tqdm

        kind: dict[str, Any] = {"total": steps, "desc": label, "unit": f" {unit}"}
        if not isinstance(steps, int):
            # Without smoothing: steps differ, so the rate of the last ones says little.
            kind = {"total": sum(steps), "bar_format": _WEIGHTED_BAR_FORMAT, "smoothing": 0}
        with tqdm(**kind, file=sys.stderr, dynamic_ncols=True) as bar:
            yield _Bar(bar, steps, label, unit)


class _Bar(Progress):
    def __init__(self, bar: tqdm[Any], steps: int | Sequence[float], label: str, unit: str) -> None:
        self._bar, self._steps, self._label, self._unit = bar, steps, label, unit
        self._num_finished = 0
        self._describe()

    def advance(self, note: str = "") -> None:
        self._bar.set_postfix_str(note, refresh=False)
        self._bar.update(1 if isinstance(self._steps, int) else self._steps[self._num_finished])
        self._num_finished += 1
        self._describe()

    def _describe(self) -> None:
        if not isinstance(self._steps, int):
            self._bar.set_description_str(f"{self._label} {self._num_finished}/{len(self._steps)} {self._unit}")


class ProgressLines(Progress):
    """Progress as lines of text. clock: returns seconds; the rest is as in `Reporter.progress`."""

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
        self._num_finished, self._finished_work, self._work_at_line = 0, 0.0, 0.0
        self._start = self._time_of_line = clock()
        self._first = (self._start, 0.0)  # when the first step was finished, and its work

    def advance(self, note: str = "") -> None:
        """Count one step more, and print a line if one is due."""
        self._finished_work += self._work[self._num_finished]
        self._num_finished += 1
        now = self._clock()
        if self._num_finished == 1:
            self._first = (now, self._finished_work)
        if not self._is_due(now):
            return
        self._work_at_line, self._time_of_line = self._finished_work, now
        print(f"{self._label}: {', '.join(self._parts(now, note))}", file=self._stream, flush=True)

    def _parts(self, now: float, note: str) -> Iterator[str]:
        yield f"{self._num_finished}/{len(self._work)} {self._unit}"
        if self._has_rate:
            yield f"{self._num_finished / max(now - self._start, 1e-9):.2f} {self._unit}/s"
        # The first step includes the start: the rate is that of the later ones, once there are some.
        since, before = self._first if self._finished_work > self._first[1] else (self._start, 0.0)
        if self._num_finished < len(self._work) and self._finished_work > before:
            remaining = (now - since) * (self._total_work - self._finished_work) / (self._finished_work - before)
            yield f"{format_duration(remaining)} left"
        if note:
            yield note

    def _is_due(self, now: float) -> bool:
        if self._num_finished == len(self._work):
            return True
        waited = now - self._time_of_line
        part = (self._finished_work - self._work_at_line) / max(self._total_work, 1e-9)
        return waited >= _MIN_LINE_INTERVAL_S and (part >= _LINE_EVERY_FRACTION or waited >= _MAX_LINE_INTERVAL_S)


def format_duration(seconds: float) -> str:
    """Return `0:07`, `12:34` or `1:02:03`."""
    minutes, whole_seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{whole_seconds:02}" if hours else f"{minutes}:{whole_seconds:02}"
