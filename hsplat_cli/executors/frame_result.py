"""A frame that was drawn, by this process or another one: its picture, and what its film's sidecar tells of it."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from renderer.film import Picture
from renderer.frame import (
    Frame,
    Rasterizer,
    ScheduleController,
    Stage,
    ToleranceController,
    frame_record,
    render_frames,
)


@dataclass(frozen=True)
class FrameResult:
    """record: plain data for JSON, as `is_frame_record` has it: the number as `frame`, `tolerance`, `cells`, `splats`,
    `seconds` by step."""

    number: int
    picture: Picture
    record: dict[str, Any]


class FrameExecutor(Protocol):
    """Draws frames of a film, wherever that is.

    drivers: devices and drivers of the frames so far, as GL names them: one, unless machines differ.
    notes: what the user should know.
    """

    @property
    def drivers(self) -> Sequence[str]: ...

    @property
    def notes(self) -> Sequence[str]: ...

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """These frames, in this order."""


class LocalExecutor:
    """Draws in this process, one frame after the other."""

    def __init__(self, stage: Stage, rasterizer: Rasterizer, controller: ToleranceController | None = None) -> None:
        self._stage, self._rasterizer = stage, rasterizer
        self._controller = ScheduleController(stage) if controller is None else controller

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """As in Drawer."""
        frames = render_frames(
            self._stage, numbers, self._rasterizer, clock=time.perf_counter, controller=self._controller
        )
        for frame in frames:
            yield make_frame_result(frame)


def make_frame_result(frame: Frame) -> FrameResult:
    """A frame of the loop."""
    return FrameResult(frame.number, Picture(frame.image), frame_record(frame))
