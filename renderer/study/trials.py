"""The coarsest tolerance whose frames are good enough: trial pictures against the truth of probe frames."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

from renderer.frame import Clock, Rasterizer, Stage, make_primitive, render_frames
from renderer.scene import MetricTarget, with_tolerance
from renderer.study.metrics import compute_metric, over_background
from renderer.study.search import find_coarsest_passing
from renderer.study.tolerances import distinct_tolerances
from renderer.study.truths import Truth, extreme_coverage_frames, is_loop, round_to_float32, spread_frames

# Frames that are probed, besides those with the smallest and the largest picture; as many lie between them as a check.
_NUM_PROBES = 4
# Of a long path, only so many frames are looked at for the smallest and the largest picture.
_MAX_SURVEYED_FRAMES = 120
# Cells of the coarse cut that is drawn to look at them.
_COARSE_CELLS = 4000

TruthOf = Callable[[int], Truth]


@dataclass(frozen=True)
class Trial:
    """One picture at a tolerance: the metric's value on a frame, the cells of the cut."""

    tolerance: float
    frame: int
    value: float
    num_cells: int


@dataclass(frozen=True)
class ToleranceSearchResult:
    """What came of a search.

    tolerance: the coarsest that is good enough; None where not even 0 is.
    frames: all that were tried, ascending. worst: the worst of them at that tolerance, or at 0.
    shows_nothing: whether nothing of the volume is seen on any of them, so that any tolerance would do.
    """

    want: MetricTarget
    tolerance: float | None
    frames: tuple[int, ...]
    worst: Trial
    shows_nothing: bool


def find_tolerance(
    stage: Stage,
    frames: Sequence[int],
    want: MetricTarget,
    rasterizer: Rasterizer,
    *,
    truth_of: TruthOf,
    clock: Clock,
    on_trial: Callable[[Trial], None],
) -> ToleranceSearchResult:
    """The coarsest tolerance at which probe frames are as near to the truth as wanted, and then the check frames, too.

    stage: with a pyramid for every tolerance. Its scene's own schedule is not looked at, nor is its overlay, which is
        no error. frames: of the film, ascending.
    truth_of: the truth of a frame, as `TruthCache` has it; asked for the same one more than once.
    on_trial: told of every picture.
    """
    stage = replace(stage, scene=replace(stage.scene, overlay="none"))
    rungs = list(distinct_tolerances(stage.pyramid, make_primitive(stage).work))
    probes, checks = _frames_to_try(stage, frames, rungs, rasterizer, clock=clock)
    trials = TrialRenderer(stage, rasterizer, want, truth_of=truth_of, clock=clock, on_trial=on_trial)
    tolerance = coarsest_tolerance(trials, rungs, probes, checks)
    tried = tuple(sorted([*probes, *checks]))
    worst = trials.worst(tolerance or 0.0, tried)
    return ToleranceSearchResult(
        want, tolerance, tried, worst, not any(truth_of(frame).on_volume.any() for frame in tried)
    )


def _frames_to_try(
    stage: Stage, frames: Sequence[int], rungs: Sequence[float], rasterizer: Rasterizer, *, clock: Clock
) -> tuple[list[int], list[int]]:
    """Probes: the largest picture first, for it is usually the worst; and checks, half-way between the spread ones."""
    path = stage.scene.camera.path
    closed = is_loop(path) and len(frames) == path.frames
    between = spread_frames(frames, 2 * _NUM_PROBES, is_loop=closed)
    looked_at = spread_frames(frames, _MAX_SURVEYED_FRAMES, is_loop=closed)
    work = make_primitive(stage).work
    coarse = next((rung for rung in rungs if work(rung) >= _COARSE_CELLS), 0.0)
    smallest, largest = extreme_coverage_frames(stage, looked_at, coarse, rasterizer, clock=clock)
    probes = list(dict.fromkeys([largest, *between[::2], smallest]))
    return probes, [frame for frame in between[1::2] if frame not in probes]


class TrialRenderer:
    """Draws trial pictures, each once, and remembers how good they were; parameters as in `find_tolerance`."""

    def __init__(
        self,
        stage: Stage,
        rasterizer: Rasterizer,
        want: MetricTarget,
        *,
        truth_of: TruthOf,
        clock: Clock,
        on_trial: Callable[[Trial], None],
    ) -> None:
        self._stage, self._rasterizer, self._clock = stage, rasterizer, clock
        self._want, self._truth_of, self._on_trial = want, truth_of, on_trial
        self._done: dict[tuple[float, int], Trial] = {}

    def first_bad(self, tolerance: float, frames: Sequence[int]) -> int | None:
        """The first of the frames that is not good enough at a tolerance; those behind it are not drawn."""
        known = [trial for frame in frames if (trial := self._done.get((tolerance, frame)))]
        for trial in known:
            if self._want.margin(trial.value) < 0:
                return trial.frame
        for trial in self._draw(tolerance, [frame for frame in frames if (tolerance, frame) not in self._done]):
            if self._want.margin(trial.value) < 0:
                return trial.frame
        return None

    def worst(self, tolerance: float, frames: Sequence[int]) -> Trial:
        """The worst of the frames at a tolerance."""
        for _ in self._draw(tolerance, [frame for frame in frames if (tolerance, frame) not in self._done]):
            pass
        return min((self._done[tolerance, frame] for frame in frames), key=lambda trial: self._want.margin(trial.value))

    def _draw(self, tolerance: float, frames: Sequence[int]) -> Iterable[Trial]:
        scene = with_tolerance(self._stage.scene, tolerance)
        stage = replace(self._stage, scene=scene)
        for frame in render_frames(stage, frames, self._rasterizer, clock=self._clock):
            picture = round_to_float32(over_background(frame.radiance, scene.output.background))
            value = compute_metric(self._want.metric, picture, self._truth_of(frame.number).picture)
            trial = Trial(tolerance, frame.number, value, frame.num_cells)
            self._done[tolerance, frame.number] = trial
            self._on_trial(trial)
            yield trial


def coarsest_tolerance(
    trials: TrialRenderer, rungs: Sequence[float], probes: Sequence[int], checks: Sequence[int]
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
        tolerance = find_coarsest_passing(is_good, rungs)
        bad = None if tolerance is None else trials.first_bad(tolerance, checks)
        if bad is None:
            return tolerance
        if tolerance == 0:
            return None
        assert tolerance is not None, "no frame was bad"
        worst_first.insert(0, bad)
        rungs = [tolerance, *(rung for rung in rungs if rung < tolerance)]
