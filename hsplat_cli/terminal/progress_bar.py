"""Shows progress: in one line on a terminal, elsewhere by a line now and then."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from typing import TextIO

from renderer.system import printable

# Share of the work after which another line is printed, if the stream is no terminal.
_LINE_EVERY_FRACTION = 0.1
# Longest time between two lines if the stream is no terminal, in seconds: a slow job shows that it is alive.
_MAX_LINE_INTERVAL_S = 60.0
# Shortest time between two lines if the stream is no terminal, in seconds: no film floods a log.
_MIN_LINE_INTERVAL_S = 2.0

# Shortest time between two updates of the line on a terminal, in seconds.
_TERMINAL_INTERVAL_S = 0.1
# A pass over voxels is shown once it has taken this long, in seconds.
_PASS_DELAY_S = 1.0
# The number of bytes of a step of a pass over voxels: a MiB.
_PASS_UNIT = 1 << 20
# Width of the progress bar on a terminal, in characters.
_BAR_WIDTH = 20


class Progress:
    """Counts finished steps and shows them in a stream, until it is closed.

    steps: the number of steps of equal cost, whose rate is shown, too; or the predicted work of each step, in any unit.
    label: the text before the progress. stream: None shows nothing. clock: a function that returns seconds. unit: the
    plural noun of a step. delay: how long nothing is shown, in seconds: of short work, nothing is.
    """

    def __init__(
        self,
        steps: int | Sequence[float],
        label: str,
        stream: TextIO | None,
        clock: Callable[[], float] = time.monotonic,
        unit: str = "frames",
        delay: float = 0.0,
    ) -> None:
        self._delay, self._is_shown = delay, False
        self._has_rate = isinstance(steps, int)
        self._work = [1.0] * steps if isinstance(steps, int) else list(steps)
        self._label, self._stream, self._clock, self._unit = printable(label), stream, clock, unit
        self._is_terminal = stream is not None and stream.isatty()
        self._total_work = sum(self._work)
        self._num_finished, self._finished_work, self._work_at_line = 0, 0.0, 0.0
        self._start = self._time_of_line = clock()
        self._first = (self._start, 0.0)  # time at which the first step was finished, and the work of that step
        if self._is_terminal and not delay:
            self._show(self._start, "")

    def advance(self, note: str = "") -> None:
        """Count a finished step, and show the progress if the last line is old. note: a few words about the step."""
        self._finished_work += self._work[self._num_finished]
        self._num_finished += 1
        now = self._clock()
        if self._num_finished == 1:
            self._first = (now, self._finished_work)
        if self._is_due(now):
            self._show(now, note)

    def say(self, text: str) -> None:
        """Print a line; on a terminal, it goes below the bar, and the next step shows the bar below the line."""
        if self._stream is not None:
            print(f"{chr(10) * self._is_terminal}{self._label}: {printable(text)}", file=self._stream, flush=True)

    def close(self) -> None:
        """End the bar's line on a terminal."""
        if self._is_terminal and self._is_shown:
            print(file=self._stream, flush=True)

    def _show(self, now: float, note: str) -> None:
        self._work_at_line, self._time_of_line, self._is_shown = self._finished_work, now, True
        text = ", ".join(self._parts(now, printable(note)))
        if self._is_terminal:
            part, width = self._finished_part(0.0), shutil.get_terminal_size().columns - 1
            text = f"{self._label}: {part:4.0%} [{'#' * int(_BAR_WIDTH * part):<{_BAR_WIDTH}}] {text}"
            print(f"\r{text[:width]:<{width}}", end="", file=self._stream, flush=True)
        elif self._stream is not None:
            print(f"{self._label}: {text}", file=self._stream, flush=True)

    def _parts(self, now: float, note: str) -> Iterator[str]:
        yield f"{self._num_finished}/{len(self._work)} {self._unit}"
        if self._has_rate and self._num_finished:
            yield f"{self._num_finished / max(now - self._start, 1e-9):.2f} {self._unit}/s"
        # The first step includes the start of the work: the rate is the rate of later steps, once there are some.
        since, before = self._first if self._finished_work > self._first[1] else (self._start, 0.0)
        if self._num_finished < len(self._work) and self._finished_work > before:
            remaining = (now - since) * (self._total_work - self._finished_work) / (self._finished_work - before)
            yield f"{format_duration(remaining)} left"
        if note:
            yield note

    def _finished_part(self, since: float) -> float:
        """Return the share of the total work that was finished after `since`, an amount of finished work."""
        return (self._finished_work - since) / max(self._total_work, 1e-9)

    def _is_due(self, now: float) -> bool:
        if now - self._start < self._delay:
            return False
        waited = now - self._time_of_line
        if self._num_finished == len(self._work) or (self._is_terminal and waited >= _TERMINAL_INTERVAL_S):
            return True
        is_much = self._finished_part(self._work_at_line) >= _LINE_EVERY_FRACTION
        return waited >= _MIN_LINE_INTERVAL_S and (is_much or waited >= _MAX_LINE_INTERVAL_S)


class PassProgress:
    """Shows each pass over voxels, and each reading of a level, that takes longer than a second, in MiB.

    stream: None shows nothing. clock: a function that returns seconds.
    """

    def __init__(self, stream: TextIO | None, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream, self._clock = stream, clock
        self._bar: Progress | None = None
        self._num_finished = 0

    def __call__(self, num_read: int, num_bytes: int, what: str) -> None:
        """Show how many of the bytes of a pass were read; 0 begins a pass. what: a name for them in messages."""
        if num_read == 0 or self._bar is None:
            self.close()
            steps, unit, self._num_finished = -(-num_bytes // _PASS_UNIT), "MiB", 0
            self._bar = Progress(steps, f"reading {what}", self._stream, self._clock, unit, _PASS_DELAY_S)
        finished = -(-num_read // _PASS_UNIT)
        for _ in range(self._num_finished, finished):
            self._bar.advance()
        self._num_finished = finished
        if num_read == num_bytes:
            self.close()

    def close(self) -> None:
        """End the line of the last pass."""
        if self._bar is not None:
            self._bar.close()
            self._bar = None


def format_duration(seconds: float) -> str:
    """Return seconds as minutes and seconds, with hours if there are any: `0:07`, `12:34` or `1:02:03`."""
    minutes, whole_seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{whole_seconds:02}" if hours else f"{minutes}:{whole_seconds:02}"
