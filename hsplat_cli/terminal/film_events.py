"""Prints the progress of a film job, and its result."""

from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

from hsplat_cli.terminal.progress_bar import Progress
from hsplat_cli.terminal.reporter import Reporter
from renderer.job import JobEvents
from renderer.record import FrameRecord
from renderer.scene import counted

if TYPE_CHECKING:
    from renderer.job import Forecast, JobResult

_PERCENT = 100


class FilmEvents(JobEvents, contextlib.AbstractContextManager["FilmEvents"]):
    """Prints the events of a film job; a context, whose end closes the last progress bar.

    noun: the primitive that is drawn, `brick` or `splat`.
    """

    def __init__(self, reporter: Reporter, noun: str) -> None:
        self._reporter, self._noun = reporter, noun
        self._bars = contextlib.ExitStack()
        self._bar: Progress | None = None
        self._truth, self._percent = -1, 0

    def __exit__(self, *_: object) -> None:
        self._bars.close()

    def started(self, label: str, num_frames: int) -> None:
        """Show a progress bar for the frames of a pass."""
        self._open_bar(num_frames, label)

    def frame_finished(self, record: FrameRecord) -> None:
        """Advance the progress bar by one frame."""
        assert self._bar is not None, "a pass has started"
        self._bar.advance(counted(record.primitives, self._noun))

    def predicted(self, forecast: Forecast) -> None:
        """Print the predicted cost of a long pass."""
        assert self._bar is not None, "a pass has started"
        size = forecast.bytes_text(forecast.num_bytes)
        self._bar.say(f"about {forecast.seconds_text}, {size}, if all frames are like the first ones")

    def pass_finished(self, summary: str) -> None:
        """Close the progress bar, and print the line about a pass."""
        self._bars.close()
        self._reporter.line(summary)

    def truth_progressed(self, frame: int, share: float) -> None:
        """Show the progress of a frame's exact picture as a bar, in percent; the bar never goes back."""
        if frame != self._truth or self._bar is None:
            self._open_bar([1.0] * _PERCENT, f"truth of frame {frame}", unit="percent")
            self._truth, self._percent = frame, 0
        assert self._bar is not None
        for _ in range(self._percent, int(_PERCENT * share)):
            self._bar.advance()
        self._percent = max(self._percent, int(_PERCENT * share))
        if self._percent == _PERCENT:
            self._bars.close()

    def note(self, text: str) -> None:
        """Close the progress bar, and print a line about the job."""
        self._bars.close()
        self._reporter.status(text)

    def _open_bar(self, steps: int | list[float], label: str, unit: str = "frames") -> None:
        self._bars.close()
        self._bars.callback(setattr, self, "_bar", None)
        self._bar = self._bars.enter_context(self._reporter.progress(steps, label=label, unit=unit))


def report_film(result: JobResult, reporter: Reporter) -> None:
    """Print a film's files and their cost in a few lines; nothing for a film that was up to date."""
    from renderer.record import visibility_text  # imported here, because it imports numpy

    record = result.film.record
    if result.summary:
        reporter.line(f"{result.file}: {result.summary}")
        if record.visibility is not None and (text := visibility_text(record.visibility)):
            reporter.line(text)
        for note in record.notes:
            reporter.note(note)
        if record.outputs:
            reporter.line(f"beside it: {', '.join(each.file for each in record.outputs)}")
        reporter.line(f"how it was made: {result.film.path}")
