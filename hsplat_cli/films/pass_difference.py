"""How much a pass of a film changed the pictures of the pass before."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

# Pictures of the pass before are kept of as many frames as fit into this.
MAX_COMPARED_BYTES = 2**26


@dataclass(frozen=True)
class Difference:
    """rmse: over all pixels and channels of `num_frames` frames, in [0, 1]."""

    rmse: float
    num_frames: int

    def __str__(self) -> str:
        return "nothing changed" if self.rmse == 0 else f"{self.psnr_db:.1f} dB from the pass before"

    @property
    def psnr_db(self) -> float:
        """Infinite where nothing changed."""
        return math.inf if self.rmse == 0 else -20 * math.log10(self.rmse)

    def record(self) -> dict[str, Any]:
        """For JSON, which has no infinity."""
        return {"rmse": self.rmse, "psnr_db": self.psnr_db if self.rmse > 0 else None, "frames": self.num_frames}


class Differences:
    """Compares each pass with the one before, on frames that are spread over the film."""

    def __init__(self, frames: Sequence[int], frame_bytes: int) -> None:
        num = min(len(frames), max(1, MAX_COMPARED_BYTES // frame_bytes))
        self._compared_frames = {frames[i * len(frames) // num] for i in range(num)}
        self._before: dict[int, npt.NDArray[np.uint8]] = {}
        self._squares: list[float] = []

    def see(self, number: int, image: npt.NDArray[np.uint8]) -> None:
        """A frame of the pass that is being drawn, uint8 [h, w, c]."""
        if number not in self._compared_frames:
            return
        if number in self._before:
            change = (image.astype(np.float32) - self._before[number]) / 255
            self._squares.append(float(np.mean(change * change, dtype=np.float64)))
        self._before[number] = image

    def finish_pass(self) -> Difference | None:
        """What the pass that has ended changed; None of the first."""
        squares, self._squares = self._squares, []
        return Difference(math.sqrt(math.fsum(squares) / len(squares)), len(squares)) if squares else None
