"""Defines the result of drawing a frame, the protocol of executors, and the executor of this process."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from renderer.film import Picture
from renderer.frame import (
    Rasterizer,
    ScheduleController,
    Stage,
    ToleranceController,
    frame_record,
    render_frames,
)
from renderer.study import FilmPlan


@dataclass(frozen=True)
class FrameResult:
    """A drawn frame.

    record: plain data for JSON, as `is_frame_record` checks it: the number as `frame`, `tolerance`, `cells`, `splats`,
    `seconds` by step.
    """

    number: int
    picture: Picture
    record: dict[str, Any]


class FrameExecutor(Protocol):
    """Draws frames of a film, in this process or elsewhere.

    plan: how frames get their tolerances. Its stage may move to shared memory while frames are drawn.
    """

    @property
    def plan(self) -> FilmPlan: ...

    @property
    def drivers(self) -> Sequence[str]:
        """Devices and drivers of the frames so far, as OpenGL names them: one, unless machines differ."""

    @property
    def notes(self) -> Sequence[str]:
        """What the user should know."""

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """Yield these frames, in this order."""


class LocalExecutor:
    """Draws in this process, one frame after the other."""

    def __init__(self, stage: Stage, rasterizer: Rasterizer, controller: ToleranceController | None = None) -> None:
        self._stage, self._rasterizer = stage, rasterizer
        self._controller = ScheduleController(stage) if controller is None else controller

    def draw(self, numbers: Sequence[int]) -> Generator[FrameResult, None, None]:
        """Yield these frames, in this order."""
        clock, controller = time.perf_counter, self._controller
        for frame in render_frames(self._stage, numbers, self._rasterizer, clock=clock, controller=controller):
            yield FrameResult(frame.number, Picture(frame.image), frame_record(frame))
