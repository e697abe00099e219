"""Which tolerance is good enough: pictures at trial tolerances against the truth of probe frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from renderer.drawing import Clock, Rasterizer, Stage
from renderer.metrics import over_background, single
from renderer.pipeline import render_frames
from renderer.schedule import at_tolerance
from renderer.search import coarsest_good
from renderer.truths import Truth


@dataclass(frozen=True)
class Trial:
    """One picture at a tolerance: the metric's value on a frame, the cells of the cut."""

    tolerance: float
    frame: int
    value: float
    num_cells: int


class Trials:
    """Draws trial pictures, each once, and remembers how good they were.

    metric: of `renderer.metrics.METRICS`, over all pixels. margin: of a value, how much better than wanted it is,
    negative where it is not good enough. truth_of: the truth of a frame. on_trial: told of every picture.
    """

    def __init__(
        self,
        stage: Stage,
        rasterizer: Rasterizer,
        *,
        metric: str,
        margin: Callable[[float], float],
        truth_of: Callable[[int], Truth],
        clock: Clock,
        on_trial: Callable[[Trial], None],
    ) -> None:
        self._stage, self._rasterizer, self._clock = stage, rasterizer, clock
        self._metric, self._margin, self._truth_of, self._on_trial = metric, margin, truth_of, on_trial
        self._done: dict[tuple[float, int], Trial] = {}

    def first_bad(self, tolerance: float, frames: Sequence[int]) -> int | None:
        """The first of the frames that is not good enough at a tolerance; those behind it are not drawn."""
        known = [trial for frame in frames if (trial := self._done.get((tolerance, frame)))]
        for trial in known:
            if self._margin(trial.value) < 0:
                return trial.frame
        for trial in self._draw(tolerance, [frame for frame in frames if (tolerance, frame) not in self._done]):
            if self._margin(trial.value) < 0:
                return trial.frame
        return None

    def worst(self, tolerance: float, frames: Sequence[int]) -> Trial:
        """The worst of the frames at a tolerance."""
        for _ in self._draw(tolerance, [frame for frame in frames if (tolerance, frame) not in self._done]):
            pass
        return min((self._done[tolerance, frame] for frame in frames), key=lambda trial: self._margin(trial.value))

    def _draw(self, tolerance: float, frames: Sequence[int]) -> Iterable[Trial]:
        scene = at_tolerance(self._stage.scene, tolerance)
        stage = replace(self._stage, scene=scene)
        for frame in render_frames(stage, frames, self._rasterizer, clock=self._clock):
            picture = over_background(frame.radiance, scene.output.background)
            value = single(self._metric, picture, self._truth_of(frame.number).picture)
            trial = Trial(tolerance, frame.number, value, frame.num_cells)
            self._done[tolerance, frame.number] = trial
            self._on_trial(trial)
            yield trial


def coarsest_tolerance(
    trials: Trials, rungs: Sequence[float], probes: Sequence[int], checks: Sequence[int]
) -> float | None:
    """The coarsest tolerance that is good enough on the probes and then on the checks; None where none is.

    A check that is not good enough becomes a probe, and the search goes on from there to finer tolerances.
    """
    worst_first = list(probes)

    def is_good(tolerance: float) -> bool:
        bad = trials.first_bad(tolerance, worst_first)
        if bad is not None:  # what failed now will probably fail again
            worst_first.remove(bad)
            worst_first.insert(0, bad)
        return bad is None

    while True:
        tolerance = coarsest_good(is_good, rungs)
        bad = None if tolerance is None else trials.first_bad(tolerance, checks)
        if bad is None:
            return tolerance
        if tolerance == 0:
            return None
        assert tolerance is not None, "no frame was bad"
        worst_first.insert(0, bad)
        rungs = [tolerance, *(rung for rung in rungs if rung < tolerance)]
