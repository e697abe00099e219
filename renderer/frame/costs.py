"""What drawing a frame costs on this machine: a model of three rates, fitted to the frames that were drawn.

    seconds = per_frame + per_splat * splats + per_pixel * pixels + per_written, for a frame that goes into a file

`pixels` are those around the footprints, each footprint by itself, or the samples along rays through bricks: what the
rasteriser looks at.
"""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.frame.frame import DrawList

Float64 = npt.NDArray[np.float64]

# A software renderer's on two cores, seconds.
_TYPICAL_RATES = np.array([5e-3, 1e-6, 8e-9, 2e-3])
# No frame takes less than this part of what it should: one at which the clock stood still must not outweigh the others.
_MIN_RELATIVE_PACE = 1e-3
# How much a rate that is off by its own size weighs against a frame that is.
_PRIOR_WEIGHT = 1e-4
# Frames of the film that the model is fitted to, the last ones; and those that tell how fast the machine is right now.
_NUM_REMEMBERED, _NUM_RECENT = 16, 7


class Workload(NamedTuple):
    """What there is to draw: splats, or bricks; pixels under them, or samples; and 1 if it goes into a file, else 0."""

    num_splats: float
    num_pixels: float
    num_written: int


def workload_of(draw_list: DrawList, *, is_written: bool = True) -> Workload:
    """What a frame draws, in all its orders."""
    return Workload(*draw_list.lod.workload(draw_list.orders, draw_list.view), int(is_written))


@dataclass(frozen=True)
class CostModel:
    """Seconds per frame, splat, pixel and written frame."""

    per_frame: float
    per_splat: float
    per_pixel: float
    per_written: float

    def seconds(self, load: Workload) -> float:
        """What drawing a frame takes, its cut and order not counted."""
        drawn = self.per_frame + self.per_splat * load.num_splats + self.per_pixel * load.num_pixels
        return drawn + self.per_written * load.num_written


def fit_costs(samples: list[tuple[Workload, float]]) -> CostModel:
    """The rates, none negative, with the least squared relative errors; `samples` are loads and their seconds.

    What they leave open is as on a typical machine of this one's speed.
    """
    amounts = np.array([(1.0, *load) for load, _ in samples]).reshape(-1, 4) * _TYPICAL_RATES
    typical = amounts.sum(axis=1)  # seconds
    paces = np.array([taken for _, taken in samples]) / typical
    speed = (float(np.median(paces)) or 1.0) if samples else 1.0
    paces = np.maximum(paces, _MIN_RELATIVE_PACE * speed)
    # Unknowns are in units of those rates, and a weak equation for each of them wants it to be 1.
    shares = amounts * (speed / (typical * paces))[:, None]
    matrix = shares.T @ shares + _PRIOR_WEIGHT * np.eye(4)
    rates = _least_squares(matrix, shares.sum(axis=0) + _PRIOR_WEIGHT)
    return CostModel(*(rates * speed * _TYPICAL_RATES).tolist())


def _least_squares(matrix: Float64, wanted: Float64) -> Float64:
    """The x >= 0 with the least `x matrix x - 2 wanted x`; matrix [n, n] is positive definite, and n small.

    It is the best without a bound, of some unknowns, the others being 0: of any choice of them, where it is legal.
    """
    best, least = np.zeros(len(wanted)), 0.0
    for chosen in product((True, False), repeat=len(wanted)):
        some = np.flatnonzero(chosen)
        x = np.linalg.solve(matrix[np.ix_(some, some)], wanted[some])
        least_objective = -float(wanted[some] @ x)  # what is minimised, where it is level
        if x.min(initial=0.0) >= 0 and least_objective < least:
            best, least = np.zeros(len(wanted)), least_objective
            best[some] = x
            if all(chosen):
                break
    return best


class CostLog:
    """The frames drawn so far, and what the next ones will take."""

    def __init__(self) -> None:
        self._trials: list[tuple[Workload, float]] = []
        self._frames: deque[tuple[Workload, float]] = deque(maxlen=_NUM_REMEMBERED)
        self._model: CostModel | None = None

    @property
    def is_empty(self) -> bool:
        """Whether nothing was drawn yet."""
        return not (self._trials or self._frames)

    def add(self, load: Workload, seconds: float) -> None:
        """A frame was drawn: of the film, where it was written, or only to see what it takes."""
        (self._frames if load.num_written else self._trials).append((load, seconds))
        self._model = None

    @property
    def model(self) -> CostModel:
        """Fitted to what was drawn."""
        if self._model is None:
            self._model = fit_costs([*self._trials, *self._frames])
        return self._model

    def predict(self, load: Workload, *, last: int = 0) -> float:
        """Seconds of drawing: the model's, corrected by what the last frames took against it.

        last: how many, at most; 0 for as many as there are otherwise. Of an even number the first is left out.
        """
        num = min(last or _NUM_RECENT, _NUM_RECENT, len(self._frames))
        recent = list(self._frames)[-(num - 1 + num % 2) :] if num else []
        drift = statistics.median(taken / self.model.seconds(drawn) for drawn, taken in recent) if recent else 1.0
        return drift * self.model.seconds(load)
