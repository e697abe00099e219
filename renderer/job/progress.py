"""Report the progress of a film to a function, or to a bar in a notebook."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from renderer.job.events import JobEvents
from renderer.job.record import FrameRecord

# Takes the number of finished frames, and that of all frames that are drawn.
OnProgress = Callable[[int, int], object]


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
