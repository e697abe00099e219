"""Hold the frames of a film that are finished, and take those that are drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path

from renderer.film import Picture, bytes_digest, has_frame_files
from renderer.job.executor import DrawnFrame
from renderer.job.record import FrameRecord
from renderer.scene import OutputSpec


class FrameStore:
    """A store of finished frames, which keeps no others: those of parts, or none at all.

    records: of the finished frames, by number. file: returns where the picture of one is.
    is_output: the pictures are the files of the output, so that no film is written of them.
    """

    is_output = False

    def __init__(self, output: OutputSpec, records: Mapping[int, FrameRecord], file: Callable[[int], Path]) -> None:
        self._output, self._file = output, file
        self.records = dict(records)

    def finished_frame(self, number: int) -> DrawnFrame:
        """Return a finished frame, whose picture is read on demand."""
        return DrawnFrame(self.records[number], Picture(file=self._file(number)))

    def save(self, frame: DrawnFrame) -> FrameRecord:
        """Return the record of a frame that was drawn, with its digest if it will have a file."""
        if not has_frame_files(self._output):
            return frame.record
        return replace(frame.record, digest=bytes_digest(frame.picture.png))
