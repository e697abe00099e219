"""What a film costs and how near it comes to the truth, at each of many settings."""

from __future__ import annotations

import statistics
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.metrics import Accuracy

# Longest side of the small pictures that are kept of each setting.
THUMBNAIL_PX = 256
# Differences from the truth are shown this many times as large.
DIFFERENCE_GAIN = 8.0


@dataclass(frozen=True)
class Setting:
    """One way to draw the film: a point of a series.

    series: the curve that it belongs to: "gaussian, optical", "gouraud 8x3, rms, uncorrected", "vtk gpu".
    label: which point of it: "tolerance 0.1", "sample distance 0.5".
    options: the choices by name, numbers and short words, for tables: tool, tolerance, footprint, ...
    """

    series: str
    label: str
    options: Mapping[str, str | float | bool]


@dataclass(frozen=True)
class Sample:
    """One frame at one setting.

    num_splats: those that the frame can show; None for a peer, which draws none.
    seconds: by stage, one for each repetition, warm.
    """

    frame: int
    num_splats: int | None
    seconds: Mapping[str, tuple[float, ...]]
    accuracy: Accuracy

    @property
    def frame_seconds(self) -> tuple[float, ...]:
        """All stages of the frame together, for each repetition."""
        return tuple(map(sum, zip(*self.seconds.values(), strict=True)))


@dataclass(frozen=True)
class Measurement:
    """One setting on some frames.

    num_cells: of its cut; None for a peer.
    seconds: what is done once for many frames (cut, splats), by stage, one for each repetition; empty for a peer.
    samples: one for each frame.
    overall: the accuracy over all frames together.
    peak_bytes: the most memory that the process held meanwhile; None where the system does not tell.
    picture, difference: uint8 [h, w, 3], the first frame and its difference from the truth times DIFFERENCE_GAIN, at
        most THUMBNAIL_PX wide and high.
    """

    setting: Setting
    num_cells: int | None
    seconds: Mapping[str, tuple[float, ...]]
    samples: tuple[Sample, ...]
    overall: Accuracy
    peak_bytes: int | None
    picture: npt.NDArray[np.uint8]
    difference: npt.NDArray[np.uint8]

    @property
    def frame_seconds(self) -> float:
        """Median time of a frame, over frames and repetitions."""
        return statistics.median(self._all_frame_seconds)

    @property
    def frame_seconds_spread(self) -> tuple[float, float]:
        """First and third quartile of the time of a frame, over frames and repetitions."""
        low, high = np.quantile(self._all_frame_seconds, [0.25, 0.75])
        return float(low), float(high)

    @property
    def num_splats(self) -> float | None:
        """Mean over the frames."""
        counts = [sample.num_splats for sample in self.samples if sample.num_splats is not None]
        return statistics.fmean(counts) if counts else None

    @property
    def _all_frame_seconds(self) -> list[float]:
        return [seconds for sample in self.samples for seconds in sample.frame_seconds]
