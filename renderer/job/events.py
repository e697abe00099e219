"""Define the listeners to a film job: a function, a progress bar in a notebook, or a subclass of `JobEvents`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from renderer.job.forecast import Forecast

if TYPE_CHECKING:
    from renderer.record import FrameRecord

# A function that takes the number of finished frames, and the number of all frames of the pass.
OnProgress = Callable[[int, int], object]


class JobEvents:
    """A listener to a film job. Its methods do nothing; a subclass overrides some of them.

    The command line prints the events, a notebook shows them, and a test counts them. An error in a method ends the job
    as an interrupt does: the finished frames are kept, and the same job resumes there.
    """

    def locked(self) -> None:
        """Take note that the output is locked for this job. The film may still turn out to be up to date."""

    def prepared(self) -> None:
        """Take note that the volume is read, that the film is not up to date, and that drawing begins."""

    def started(self, label: str, num_frames: int) -> None:
        """Take note that a pass begins.

        label: the name of the film, or of its pass. num_frames: the number of frames to draw; the number of frames to
        write, if all are already drawn.
        """

    def frame_finished(self, record: FrameRecord) -> None:
        """Take note that one of the frames of a pass is stored and written to the film. record: its record."""

    def predicted(self, forecast: Forecast) -> None:
        """Take note of the seconds and bytes that a long pass will cost, as predicted from its first frames."""

    def pass_finished(self, summary: str) -> None:
        """Take note that a pass is finished, and is a whole film. summary: a line on its accuracy, cells and time."""

    def volume_noted(self, text: str) -> None:
        """Take a sentence on how the volume was read. Unless a subclass overrides this, `note` takes the sentence."""
        self.note(text)

    def note(self, text: str) -> None:
        """Take a sentence about the film, which is meant for the user."""


class ProgressEvents(JobEvents):
    """A listener that counts the frames of a pass, and calls a function after each frame."""

    def __init__(self, on_progress: OnProgress) -> None:
        self._on_progress, self._num_finished, self._num_frames = on_progress, 0, 0

    def started(self, label: str, num_frames: int) -> None:
        """Start counting the frames of a pass at 0."""
        self._num_finished, self._num_frames = 0, num_frames

    def frame_finished(self, record: FrameRecord) -> None:
        """Count the finished frame, and call the function with the numbers of finished frames and of all frames."""
        self._num_finished += 1
        self._on_progress(self._num_finished, self._num_frames)


class NotebookBar(JobEvents):
    """A progress bar below the cell of a notebook, from the beginning of a pass on. Elsewhere, it shows nothing."""

    def __init__(self) -> None:
        ipython: Any = sys.modules.get("IPython")
        shell = ipython.get_ipython() if ipython else None
        self._display = ipython.display if hasattr(shell, "kernel") else None
        self._handle: Any = None
        self._num_finished, self._num_frames = 0, 0

    def started(self, label: str, num_frames: int) -> None:
        """Show the bar of a pass."""
        self._num_finished, self._num_frames = 0, num_frames
        self._show()

    def frame_finished(self, record: FrameRecord) -> None:
        """Show the share of the finished frames."""
        self._num_finished += 1
        self._show()

    def _show(self) -> None:
        if self._display is None:
            return
        finished, frames = self._num_finished, self._num_frames
        text = f"{finished} of {frames} frames"
        bar = self._display.HTML(f'<progress max="{frames}" value="{finished}"></progress> {text}')
        if self._handle is None:
            self._handle = self._display.display(bar, display_id=True)
        else:
            self._handle.update(bar)
