"""Search for the coarsest tolerance whose frames are accurate enough, by trial pictures of probe frames.

An accuracy need not rise with every step to a finer tolerance, so the search does not start from both ends: it comes
down from the coarse side in steps of about two to the first tolerance that is good enough, and bisects only between
that one and the one before.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from renderer.frame import Clock, Rasterizer, Stage, make_primitive, render_frames
from renderer.pyramid import Pyramid, root_error
from renderer.scene import MIN_TOLERANCE, MetricTarget, with_tolerance
from renderer.study.metrics import compute_metric, over_background
from renderer.study.truths import Truth, extreme_coverage_frames, is_loop, round_to_float32, spread_evenly

# Probe frames besides those with the smallest and the largest picture; as many check frames lie between them.
_NUM_PROBES = 4
# On a long path, only this many frames are drawn to find the smallest and the largest picture.
_MAX_SURVEYED_FRAMES = 120
# Cells of the coarse cut that is drawn for this.
_COARSE_CELLS = 4000

# A cut of fewer cells, or of a smaller part of the finest cut, is too blurred to be of use.
_MIN_CELLS = 64
_MIN_CELL_SHARE = 1e-3
# From one tolerance of a sweep to the next, at least this many times as much is drawn.
_MIN_GROWTH = 1.1
# The same for the tolerances of a search.
_MIN_DISTINCT_GROWTH = 1.03
# From this share of the finest work on, a cut is as good as the finest.
_NEARLY_ALL = 0.9
# Errors in float16 span fewer decades.
_MAX_DECADES = 12

TruthOf = Callable[[int], Truth]
# How much is drawn at a tolerance, as in `renderer.frame.primitives.Primitive`.
Work = Callable[[float], float]


@dataclass(frozen=True)
class Trial:
    """One picture at a tolerance: the metric's value on a frame, and the number of cells in the cut."""

    tolerance: float
    frame: int
    value: float
    num_cells: int


@dataclass(frozen=True)
class ToleranceSearchResult:
    """The result of a search for a tolerance.

    tolerance: the coarsest one that is good enough; None if not even 0 is.
    frames: all frames tried, ascending. worst: the worst of them at that tolerance, or at 0.
    shows_nothing: whether none of them shows anything of the volume, so that any tolerance would do.
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
    """Find the coarsest tolerance at which probe frames, and then check frames, are as near to the truth as wanted.

    stage: with a pyramid for every tolerance. The schedule of its scene is ignored, and so is its overlay, which is no
        error. frames: of the film, ascending.
    truth_of: returns the truth of a frame, such as a `TruthCache`; it is called several times for a frame.
    on_trial: called after every picture.
    """
    stage = replace(stage, scene=replace(stage.scene, overlay="none"))
    candidates = list(distinct_tolerances(stage.pyramid, make_primitive(stage).work))
    probes, checks = _frames_to_try(stage, frames, candidates, rasterizer, clock=clock)
    trials = TrialRenderer(stage, rasterizer, want, truth_of=truth_of, clock=clock, on_trial=on_trial)
    tolerance = coarsest_tolerance(trials, candidates, probes, checks)
    tried = tuple(sorted([*probes, *checks]))
    worst = trials.worst(tolerance or 0.0, tried)
    shows_nothing = not any(truth_of(frame).on_volume.any() for frame in tried)
    return ToleranceSearchResult(want, tolerance, tried, worst, shows_nothing)


def _frames_to_try(
    stage: Stage, frames: Sequence[int], candidates: Sequence[float], rasterizer: Rasterizer, *, clock: Clock
) -> tuple[list[int], list[int]]:
    """Return the probes, the largest and usually worst picture first, and the checks, half-way between probes."""
    path = stage.scene.camera.path
    closed = is_loop(path) and len(frames) == path.frames
    between = spread_evenly(frames, 2 * _NUM_PROBES, is_loop=closed)
    surveyed = spread_evenly(frames, _MAX_SURVEYED_FRAMES, is_loop=closed)
    work = make_primitive(stage).work
    coarse = next((tolerance for tolerance in candidates if work(tolerance) >= _COARSE_CELLS), 0.0)
    smallest, largest = extreme_coverage_frames(stage, surveyed, coarse, rasterizer, clock=clock)
    probes = list(dict.fromkeys([largest, *between[::2], smallest]))
    return probes, [frame for frame in between[1::2] if frame not in probes]


class TrialRenderer:
    """Draws each trial picture once, and remembers its accuracy; parameters as in `find_tolerance`."""

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
        self._trials: dict[tuple[float, int], Trial] = {}

    def first_bad(self, tolerance: float, frames: Sequence[int]) -> int | None:
        """Return the first frame found that is not good enough, known ones first; later frames are not drawn."""
        known = [trial for frame in frames if (trial := self._trials.get((tolerance, frame)))]
        for trials in (known, self._draw_missing(tolerance, frames)):
            for trial in trials:
                if self._want.margin(trial.value) < 0:
                    return trial.frame
        return None

    def worst(self, tolerance: float, frames: Sequence[int]) -> Trial:
        """Return the worst of the frames at a tolerance."""
        list(self._draw_missing(tolerance, frames))
        trials = (self._trials[tolerance, frame] for frame in frames)
        return min(trials, key=lambda trial: self._want.margin(trial.value))

    def _draw_missing(self, tolerance: float, frames: Sequence[int]) -> Iterator[Trial]:
        missing = [frame for frame in frames if (tolerance, frame) not in self._trials]
        scene = with_tolerance(self._stage.scene, tolerance)
        stage = replace(self._stage, scene=scene)
        for frame in render_frames(stage, missing, self._rasterizer, clock=self._clock):
            picture = round_to_float32(over_background(frame.radiance, scene.output.background))
            value = compute_metric(self._want.metric, picture, self._truth_of(frame.number).picture)
            trial = Trial(tolerance, frame.number, value, frame.num_cells)
            self._trials[tolerance, frame.number] = trial
            self._on_trial(trial)
            yield trial


def coarsest_tolerance(
    trials: TrialRenderer, candidates: Sequence[float], probes: Sequence[int], checks: Sequence[int]
) -> float | None:
    """Return the coarsest tolerance that is good enough on the probes and then on the checks, or None.

    A check that is not good enough becomes a probe, and the search continues from there to finer tolerances.
    """
    worst_first = list(probes)

    def is_good(tolerance: float) -> bool:
        bad = trials.first_bad(tolerance, worst_first)
        if bad is not None:  # it will probably fail again
            worst_first.remove(bad)
            worst_first.insert(0, bad)
        return bad is None

    while True:
        tolerance = find_coarsest_passing(is_good, candidates)
        bad = None if tolerance is None else trials.first_bad(tolerance, checks)
        if bad is None:
            return tolerance
        if tolerance == 0:
            return None
        assert tolerance is not None, "no frame was bad"
        worst_first.insert(0, bad)
        candidates = [tolerance, *(finer for finer in candidates if finer < tolerance)]


def find_coarsest_passing(is_good: Callable[[float], bool], candidates: Iterable[float]) -> float | None:
    """Return the coarsest good tolerance found, of two digits; 0 if only that is good, None if nothing is.

    candidates: tolerances > 0, falling; the last of them draws what 0 draws, or nearly. None is tried twice.
    """
    before = None
    for tolerance in candidates:
        if is_good(tolerance):
            if before is None:
                return tolerance
            between = two_digit_numbers(before, tolerance)
            return between[bisect_left(between, True, 1, len(between) - 1, key=is_good)]
        before = tolerance
    return 0.0 if is_good(0.0) else None


def round_tolerances(pyramid: Pyramid) -> Iterator[float]:
    """Yield 1, 2 and 5 times powers of ten, downward from the first at which the whole volume is a single cell.

    Ends after 12 decades. A pyramid without error is one cell at any tolerance: 1 is yielded.
    """
    top = root_error(pyramid)
    if top == 0:
        yield 1.0
        return
    exponent = math.floor(math.log10(top)) + 1
    tolerances = [float(f"{digit}e{exponent - i}") for i in range(_MAX_DECADES) for digit in (5, 2, 1)]
    num_above = sum(tolerance > top for tolerance in tolerances)
    yield from tolerances[num_above - 1 :]


def distinct_tolerances(pyramid: Pyramid, work: Work, growth: float = _MIN_DISTINCT_GROWTH) -> Iterator[float]:
    """Yield the round tolerances at which clearly more is drawn than at the one before, until nearly all is drawn."""
    before, everything = 0.0, work(MIN_TOLERANCE)  # below any error that a pyramid can hold
    for tolerance in round_tolerances(pyramid):
        amount = work(tolerance)
        if amount > growth * before:
            yield tolerance
            before = amount
        if growth * before >= everything:
            return


def spread_tolerances(pyramid: Pyramid, work: Work, most: int) -> tuple[float, ...]:
    """Return at most `most` falling tolerances that show how a film improves; the last is 0."""
    if root_error(pyramid) == 0:
        return 1.0, 0.0
    everything = work(0.0)
    fewest, nearly_all = max(_MIN_CELLS, _MIN_CELL_SHARE * everything), _NEARLY_ALL * everything
    distinct = distinct_tolerances(pyramid, work, _MIN_GROWTH)
    found = [tolerance for tolerance in distinct if fewest <= work(tolerance) <= nearly_all]
    return (*spread_evenly(found, most - 1, is_loop=False), 0.0)


def two_digit_numbers(coarsest: float, finest: float) -> list[float]:
    """Return the numbers of two significant digits from `coarsest` down to `finest`, both > 0: at most 11 % apart.

    Such a tolerance can be written into a scene without rounding it.
    """
    low, high = math.floor(math.log10(finest)), math.floor(math.log10(coarsest))
    numbers = (
        float(f"{digits}e{exponent - 1}") for exponent in range(high, low - 1, -1) for digits in range(99, 9, -1)
    )
    return [number for number in numbers if finest <= number <= coarsest]
