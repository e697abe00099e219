"""A frame is stored while the next one is drawn, unless its time counts for it, and even when drawing fails."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest

from renderer.film import Picture
from renderer.job import DrawnFrame, FrameStore, JobEvents, OutputWriter
from renderer.record import FrameRecord
from renderer.scene import OutputSpec

LONGEST_S = 30.0  # until a thread that waits is taken for stuck
NUM_FRAMES = 4


class WaitingStore(FrameStore):
    """A store that takes each frame once the drawing of the next one has begun, if frames overlap."""

    is_output = True

    def __init__(self, output: OutputSpec, *, is_overlapped: bool) -> None:
        super().__init__(output, {}, Path)
        self.begun = [threading.Event() for _ in range(NUM_FRAMES)]
        self.steps: list[str] = []
        self._is_overlapped = is_overlapped

    def save(self, frame: DrawnFrame) -> FrameRecord:
        number = frame.record.frame
        if self._is_overlapped and number + 1 < NUM_FRAMES:
            assert self.begun[number + 1].wait(LONGEST_S)
        self.steps.append(f"store {number}")
        return frame.record

    def draw(self, error: BaseException | None) -> Iterator[DrawnFrame]:
        """Yield frames, and raise this at the last one."""
        for number, begins in enumerate(self.begun):
            self.steps.append(f"draw {number}")
            begins.set()
            if error is not None and number == NUM_FRAMES - 1:
                raise error
            yield DrawnFrame(FrameRecord(number, 0.0, 1, 1, {}), {0: Picture(content=b"")})


def write(folder: Path, error: BaseException | None = None, *, is_overlapped: bool) -> list[str]:
    """Return what was done, in order."""
    output = OutputWriter(OutputSpec(folder / "{frame}.png"), range(NUM_FRAMES), folder / "frames.json", folder)
    store = WaitingStore(output.spec, is_overlapped=is_overlapped)
    with nullcontext() if error is None else pytest.raises(type(error)):
        output.write_frames(store, store.draw(error), "film", JobEvents(), lambda: None, is_overlapped=is_overlapped)
    return store.steps


@pytest.mark.parametrize("error", [None, ValueError(), KeyboardInterrupt()])
def test_frames_overlap_and_those_that_were_drawn_are_stored(error: BaseException | None, tmp_path: Path) -> None:
    stored = [step for step in write(tmp_path, error, is_overlapped=True) if "store" in step]
    assert stored == [f"store {number}" for number in range(NUM_FRAMES - (error is not None))]


def test_frames_whose_time_counts_do_not_overlap(tmp_path: Path) -> None:
    expected = [f"{step} {number}" for number in range(NUM_FRAMES) for step in ("draw", "store")]
    assert write(tmp_path, is_overlapped=False) == expected
