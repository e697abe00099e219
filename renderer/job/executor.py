"""Define what draws the frames of a film, and draw them in this process.

Every executor draws the same bytes: this process with all its threads, or a cluster.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Protocol

from renderer.draw import BrickMemory, Rasterizer, open_rasterizer
from renderer.film import Picture
from renderer.frame import FilmStage, Frame, ToleranceController, render_frames
from renderer.job.film_accuracy import frame_accuracy
from renderer.job.make_record import frame_record
from renderer.job.pictures import PictureMaker
from renderer.job.plan import FilmPlan
from renderer.job.record import FrameRecord
from renderer.scene import FilmScene
from renderer.system import MemoryShare, num_cores

if TYPE_CHECKING:
    from renderer.accuracy import FrameProber


@dataclass(frozen=True)
class DrawnFrame:
    """A frame that is drawn: its record, and its pictures by the numbers of their kinds.

    finish: returns it with all pictures, and with its accuracy in its record; None for one that has them.
    """

    record: FrameRecord
    pictures: Mapping[int, Picture]
    finish: Callable[[], DrawnFrame] | None = None

    def finished(self) -> DrawnFrame:
        """Return the frame with all that belongs to it; exact rays, and more pictures, take a while."""
        return self if self.finish is None else self.finish()


class Executor(Protocol):
    """A way to draw frames: this process, or a cluster.

    device: what draws, on which the bytes depend; where machines may differ, records of frames have their own.
    brick_memory: as of a Rasterizer; None where other processes draw. rasterizer: draws trial frames in this process.
    """

    @property
    def device(self) -> str: ...

    @property
    def brick_memory(self) -> BrickMemory | None: ...

    @property
    def rasterizer(self) -> Rasterizer: ...

    @property
    def notes(self) -> Sequence[str]:
        """Return what the user should know about the drawing so far."""

    def draw(self, plan: FilmPlan, numbers: Sequence[int]) -> Generator[DrawnFrame, None, None]:
        """Yield these frames, in this order; may be closed before its end."""


@dataclass(frozen=True)
class LocalExecutor:
    """An executor that draws in this process, one frame after the other, each with all threads."""

    rasterizer: Rasterizer

    @property
    def device(self) -> str:
        """Return device and driver of OpenGL for splats, and the processor for bricks."""
        return self.rasterizer.device

    @property
    def brick_memory(self) -> BrickMemory | None:
        """Return the memory of bricks."""
        return self.rasterizer.brick_memory

    @property
    def notes(self) -> Sequence[str]:
        """Return what the user should know about the drawing so far."""
        return self.rasterizer.notes

    def draw(self, plan: FilmPlan, numbers: Sequence[int]) -> Generator[DrawnFrame, None, None]:
        """Yield these frames, in this order; may be closed before its end."""
        # Imported here: the ray integral takes a while to load.
        from renderer.accuracy import open_prober

        return draw_frames(plan.stage, numbers, self.rasterizer, plan.controller, open_prober(plan.stage, num_cores()))


@contextlib.contextmanager
def open_local_executor(scene: FilmScene, memory: MemoryShare | None = None) -> Iterator[LocalExecutor]:
    """Open an executor of this process for a scene. Raises RenderError where it needs OpenGL and there is none.

    memory: as of `open_rasterizer`.
    """
    with open_rasterizer(scene, memory) as rasterizer:
        yield LocalExecutor(rasterizer)


def draw_frames(
    stage: FilmStage,
    numbers: Sequence[int],
    rasterizer: Rasterizer,
    controller: ToleranceController,
    prober: FrameProber | None = None,
) -> Generator[DrawnFrame, None, None]:
    """Draw these frames in this process, one after the other.

    prober: measures their accuracy. Other parameters are those of `render_frames`.
    """
    maker = PictureMaker(stage)
    for frame in render_frames(stage, numbers, rasterizer, clock=time.perf_counter, controller=controller):
        prober = prober and prober.on(frame.stage)
        record = frame_record(frame, stage)
        yield DrawnFrame(record, {0: Picture(frame.image)}, partial(_finish, frame, record, maker, prober))


def _finish(frame: Frame, record: FrameRecord, maker: PictureMaker, prober: FrameProber | None) -> DrawnFrame:
    """Measure the accuracy of a frame, then make its pictures, over which annotation may be drawn."""
    if prober is not None:
        start = time.perf_counter()
        probe = prober.probe(frame.number, frame.image)
        seconds = {**record.seconds, "probe": time.perf_counter() - start}
        record = replace(record, accuracy=frame_accuracy(probe), visible=probe.visible, seconds=seconds)
    start = time.perf_counter()
    pictures = maker.pictures(frame, record)
    seconds = {**record.seconds, "pictures": time.perf_counter() - start}
    return DrawnFrame(replace(record, seconds=seconds), pictures)
