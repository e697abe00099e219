"""How far the work is: a bar on a terminal, a line now and then elsewhere, on the standard error stream."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, Protocol, TextIO

if TYPE_CHECKING:
    from tqdm import tqdm

# A line is due after this part of the work or this time, whichever comes first, but never sooner than the least time:
# a short film prints a few lines, a long one does not look dead, and neither floods a log.
_LINE_EVERY_PART = 0.1
_LINE_EVERY_S = 60.0
_LINE_AT_LEAST_S = 2.0


class Progress(Protocol):
    """Counts finished frames."""

    def advance(self, note: str = "") -> None:
        """One frame more is done; `note` is a few words about it."""


@contextlib.contextmanager
def progress(total: int, *, label: str, quiet: bool) -> Iterator[Progress]:
    """Show how many of `total` frames are done, their rate and the time remaining; nothing when `quiet`."""
    if quiet:
        yield _Silence()
    elif sys.stderr.isatty():
        # Imported only where a bar is drawn: a plain log does not need it.
        from tqdm import tqdm  # noqa: PLC0415

        with tqdm(total=total, desc=label, unit=" frames", file=sys.stderr, dynamic_ncols=True) as bar:
            yield _Bar(bar)
    else:
        yield Lines(total, label, sys.stderr, time.monotonic)


class _Silence:
    def advance(self, note: str = "") -> None:
        pass


class _Bar:
    def __init__(self, bar: tqdm[Any]) -> None:
        self._bar = bar

    def advance(self, note: str = "") -> None:
        self._bar.set_postfix_str(note, refresh=False)
        self._bar.update()


class Lines:
    """Progress as lines of text; `clock` gives seconds."""

    def __init__(self, total: int, label: str, stream: TextIO, clock: Callable[[], float]) -> None:
        self._total, self._label, self._stream, self._clock = total, label, stream, clock
        self._done = self._done_at_line = 0
        self._start = self._time_of_line = clock()

    def advance(self, note: str = "") -> None:
        """One frame more is done: a line, if one is due."""
        self._done += 1
        now = self._clock()
        if not self._is_due(now):
            return
        self._done_at_line, self._time_of_line = self._done, now
        rate = self._done / max(now - self._start, 1e-9)
        parts = [f"{self._done}/{self._total} frames", f"{rate:.2f} frames/s"]
        parts += [f"{duration((self._total - self._done) / rate)} left"] if self._done < self._total else []
        parts += [note] if note else []
        print(f"{self._label}: {', '.join(parts)}", file=self._stream, flush=True)

    def _is_due(self, now: float) -> bool:
        if self._done == self._total:
            return True
        waited = now - self._time_of_line
        part = (self._done - self._done_at_line) / self._total
        return waited >= _LINE_AT_LEAST_S and (part >= _LINE_EVERY_PART or waited >= _LINE_EVERY_S)


def duration(seconds: float) -> str:
    """`0:07`, `12:34` or `1:02:03`."""
    minutes, whole_seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{whole_seconds:02}" if hours else f"{minutes}:{whole_seconds:02}"
