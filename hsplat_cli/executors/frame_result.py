"""Defines the result of drawing a frame, and draws frames in this process."""

from __future__ import annotations

import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Any

from renderer.film import Picture
from renderer.frame import Rasterizer, Stage, ToleranceController, frame_record, render_frames


@dataclass(frozen=True)
class FrameResult:
    """A drawn frame.

    record: plain data for JSON, as `is_frame_record` checks it: the number as `frame`, `tolerance`, `cells`, `splats`,
    `seconds` by step.
    """

    number: int
    picture: Picture
    record: dict[str, Any]


def draw_locally(
    stage: Stage, numbers: Sequence[int], rasterizer: Rasterizer, controller: ToleranceController | None = None
) -> Generator[FrameResult, None, None]:
    """Draw these frames in this process, one after the other; parameters are those of `render_frames`."""
    for frame in render_frames(stage, numbers, rasterizer, clock=time.perf_counter, controller=controller):
        yield FrameResult(frame.number, Picture(frame.image), frame_record(frame))
