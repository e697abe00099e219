"""Define executors, which draw the frames of a film, and draw frames in this process.

Every executor draws the same bytes: this process with all its threads, or a cluster.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

from renderer.draw import BrickMemory, Rasterizer, open_rasterizer
from renderer.film import Picture
from renderer.frame import FilmStage, Frame, Stopwatch, ToleranceController, render_frames
from renderer.job.picture_maker import PictureMaker
from renderer.job.plan import FilmPlan
from renderer.record import FrameRecord, frame_accuracy, make_frame_record, round_share
from renderer.scene import FilmScene
from renderer.system import MemoryShare, num_cores, overlap

if TYPE_CHECKING:
    from renderer.accuracy import FrameProber


# The names of the timed steps that measure a drawn frame and make its pictures, while the next frame is drawn.
FINISHING_STEPS = ("probe", "pictures")


@dataclass(frozen=True)
class DrawnFrame:
    """A drawn frame: its record, which has its accuracy, and its pictures by the numbers of their kinds."""

    record: FrameRecord
    pictures: Mapping[int, Picture]


class Executor(Protocol):
    """A way to draw frames: by this process, or by a cluster.

    device: the name of the device that draws; the bytes depend on it. On a cluster, whose machines may differ, the
        record of each frame names its own device.
    brick_memory: the bytes that the scene's visible bricks need, and may take; None for splats, before anything is
        drawn, and if other processes draw.
    rasterizer: the rasterizer that draws trial frames in this process.
    """

    @property
    def device(self) -> str: ...

    @property
    def brick_memory(self) -> BrickMemory | None: ...

    @property
    def rasterizer(self) -> Rasterizer: ...

    @property
    def notes(self) -> Sequence[str]:
        """Return notes for the user on the drawing so far."""

    def draw(self, plan: FilmPlan, numbers: Sequence[int]) -> Generator[DrawnFrame, None, None]:
        """Draw these frames, and yield them in this order. The generator may be closed before its end."""


@dataclass(frozen=True)
class LocalExecutor:
    """An executor that draws in this process: one frame after the other, each with all threads."""

    rasterizer: Rasterizer

    @property
    def device(self) -> str:
        """Return the name of what draws: the device and the driver of OpenGL for splats, the processor for bricks."""
        return self.rasterizer.device

    @property
    def brick_memory(self) -> BrickMemory | None:
        """Return the bytes that the scene's visible bricks need, and may take; None before anything is drawn."""
        return self.rasterizer.brick_memory

    @property
    def notes(self) -> Sequence[str]:
        """Return notes for the user on the drawing so far."""
        return self.rasterizer.notes

    def draw(self, plan: FilmPlan, numbers: Sequence[int]) -> Generator[DrawnFrame, None, None]:
        """Draw these frames, and yield them in this order. The generator may be closed before its end."""
        # The import is here because the ray integral takes a while to load.
        from renderer.accuracy import open_prober

        # On a budget of seconds, the whole time of a frame counts, so no step of it may overlap with the next frame.
        return draw_frames(
            plan.stage,
            numbers,
            self.rasterizer,
            plan.controller,
            open_prober(plan.stage, num_cores()),
            is_overlapped=not plan.is_timing_dependent,
        )


@contextlib.contextmanager
def open_local_executor(scene: FilmScene, memory: MemoryShare | None = None) -> Iterator[LocalExecutor]:
    """Open an executor of this process for a scene. Raises RenderError if it needs OpenGL and there is none.

    memory: the memory that bricks may take; None for half of the free memory.
    """
    with open_rasterizer(scene, memory) as rasterizer:
        yield LocalExecutor(rasterizer)


def draw_frames(
    stage: FilmStage,
    numbers: Sequence[int],
    rasterizer: Rasterizer,
    controller: ToleranceController,
    prober: FrameProber | None = None,
    *,
    is_overlapped: bool = True,
) -> Generator[DrawnFrame, None, None]:
    """Draw these frames in this process, one after the other, and yield them.

    controller: the controller that chooses the tolerances. prober: the prober that measures the accuracy of each frame;
    None to measure nothing. is_overlapped: whether a frame is measured, and its pictures are made, while the next frame
    is drawn.
    """
    finisher = _FrameFinisher(stage, prober)
    frames = render_frames(stage, numbers, rasterizer, clock=time.perf_counter, controller=controller)
    yield from overlap(frames, finisher.finish) if is_overlapped else map(finisher.finish, frames)


class _FrameFinisher:
    """A finisher of drawn frames, which measures their accuracy, and then makes their pictures with annotation."""

    def __init__(self, film: FilmStage, prober: FrameProber | None) -> None:
        self._film, self._prober, self._maker = film, prober, PictureMaker(film)

    def finish(self, frame: Frame) -> DrawnFrame:
        """Return the frame with its accuracy and all of its pictures."""
        record, watch = make_frame_record(frame, self._film), Stopwatch(time.perf_counter)
        if self._prober is not None:
            self._prober = self._prober.on(frame.stage)
            probe = self._prober.probe(frame.number, frame.image)
            visible = tuple(map(round_share, probe.visible))
            record = replace(record, accuracy=frame_accuracy(probe), visible=visible)
            watch.lap("probe")
        pictures = self._maker.pictures(frame, None if record.accuracy is None else record.accuracy.psnr)
        watch.lap("pictures")
        return DrawnFrame(replace(record, seconds={**record.seconds, **watch.seconds}), pictures)
