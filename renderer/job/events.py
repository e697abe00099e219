"""Define what a film job tells while it runs."""

from __future__ import annotations

from renderer.job.record import FrameRecord


class JobEvents:
    """A listener to a film job, whose methods do nothing: a listener of your own overrides some of them.

    The command line prints what they tell, a notebook shows it, and a test counts it. What a method raises ends the job
    as an interrupt does: the frames that are finished are kept, and the same job resumes there.
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

    def pass_finished(self, summary: str) -> None:
        """Take note that a pass is a whole film. summary: what it has, and what it cost."""

    def truth_progressed(self, frame: int, share: float) -> None:
        """Take note that this share of a frame's exact picture is computed, which may also fall."""

    def note(self, text: str) -> None:
        """Take a sentence about what happens."""
