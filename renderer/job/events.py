"""Define the listeners to a film job: a function, a bar in a notebook, or a listener of your own."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from renderer.job.forecast import Forecast

if TYPE_CHECKING:
    from renderer.record import FrameRecord

# Takes the number of finished frames, and the number of all frames that are drawn.
OnProgress = Callable[[int, int], object]


class JobEvents:
    """A listener to a film job, whose methods do nothing: a listener of your own overrides some of them.

    The command line prints the news, a notebook shows them, and a test counts them. An error that a method raises ends
    the job as an interrupt does: the frames that are finished are kept, and the same job resumes there.
    """

    def locked(self) -> None:
        """Take note that the output is locked until the film is made; it may be up to date."""

    def prepared(self) -> None:
        """Take note that the volume is read and the film is not up to date: the work begins."""

    def started(self, label: str, num_frames: int) -> None:
        """Take note that a pass begins. label: the film, or its pass.

        num_frames: the frames to draw; those to write, where all of them are finished.
        """

    def frame_finished(self, record: FrameRecord) -> None:
        """Take note that one of these frames is stored, and in the film."""

    def predicted(self, forecast: Forecast) -> None:
        """Take note of the cost of a long pass if all its frames are like the first ones."""

    def pass_finished(self, summary: str) -> None:
        """Take note that a pass is a whole film. summary: its accuracy, its size and its time."""

    def volume_noted(self, text: str) -> None:
        """Take a remark on how the volume was read, as any other note."""
        self.note(text)

    def note(self, text: str) -> None:
        """Take a sentence about the work."""


class ProgressEvents(JobEvents):
    """A listener that counts the frames of a pass, and calls a function after each."""

    def __init__(self, on_progress: OnProgress) -> None:
        self._on_progress, self._num_finished, self._num_frames = on_progress, 0, 0

    def started(self, label: str, num_frames: int) -> None:
        """Count from 0."""
        self._num_finished, self._num_frames = 0, num_frames

    def frame_finished(self, record: FrameRecord) -> None:
        """Count a frame."""
        self._num_finished += 1
        self._on_progress(self._num_finished, self._num_frames)


class NotebookBar:
    """A progress bar below a notebook's cell; it shows nothing elsewhere."""

    def __init__(self) -> None:
        ipython: Any = sys.modules.get("IPython")
        shell = ipython.get_ipython() if ipython else None
        self._ipython = ipython if hasattr(shell, "kernel") else None
        self._bar: Any = None

    def __call__(self, num_finished: int, num_frames: int) -> None:
        """Show how many of the frames are finished."""
        if self._ipython is None:
            return
        if self._bar is None:
            self._bar = self._ipython.display.ProgressBar(num_frames)
            self._bar.display()
        self._bar.progress = num_finished
