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
from functools import cache, lru_cache

import numpy as np

from renderer.draw import Rasterizer
from renderer.film import over_background
from renderer.frame import Clock, ScheduleController, Stage, make_primitive, render_frames
from renderer.pyramid import Pyramid, root_error
from renderer.scene import MIN_TOLERANCE, MetricTarget, with_tolerance
from renderer.study.metrics import compute_metric
from renderer.study.truths import Truth, extreme_coverage_frames, is_loop, spread_evenly

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

# How much is drawn at a tolerance, as in `renderer.frame.primitives.Primitive`.
Work = Callable[[float], float]


@dataclass(frozen=True)
class Trial:
    """A picture at a tolerance: the metric's value on a frame, and the number of cells in the cut."""

    tolerance: float
    frame: int
    value: float
    num_cells: int


@dataclass(frozen=True)
class ToleranceSearchResult:
    """A result of a search for a tolerance.

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
    find_truth: Callable[[int], Truth],
    clock: Clock,
    on_trial: Callable[[Trial], None],
) -> ToleranceSearchResult:
    """Find the coarsest tolerance at which probe frames, and then check frames, are as near to the truth as wanted.

    stage: with a pyramid for every tolerance. The schedule of its scene is ignored, and so is its overlay, which is no
        error. frames: of the film, ascending.
    find_truth: returns the truth of a frame; it is called once for a frame. Pictures of truths are kept in float32, 12
        bytes a pixel. Trials are rounded alike, so that equal pictures stay equal: values change by at most 3e-8, a
        three hundredth of TRUTH_TOLERANCE, and an RMSE by 6e-8, which is 0.005 dB at 80 dB.
    on_trial: called after every picture. None is drawn twice.
    """
    stage = replace(stage, scene=replace(stage.scene, overlay="none"))

    @cache
    def truth_of(frame: int) -> Truth:
        truth = find_truth(frame)
        return replace(truth, picture=truth.picture.astype(np.float32))

    @lru_cache(maxsize=1)  # has a level of detail in memory
    def controller_at(tolerance: float) -> tuple[Stage, ScheduleController]:
        at_tolerance = replace(stage, scene=with_tolerance(stage.scene, tolerance))
        return at_tolerance, ScheduleController(at_tolerance)

    @cache
    def trial(tolerance: float, number: int) -> Trial:
        at_tolerance, controller = controller_at(tolerance)
        (frame,) = render_frames(at_tolerance, [number], rasterizer, clock=clock, controller=controller)
        picture = over_background(frame.radiance, stage.scene.output.background)
        rounded = picture.astype(np.float32).astype(np.float64)
        value = compute_metric(want.metric, rounded, truth_of(number).picture)
        made = Trial(tolerance, number, value, frame.num_cells)
        on_trial(made)
        return made

    candidates = list(distinct_tolerances(stage.pyramid, make_primitive(stage).work))
    probes, checks = _frames_to_try(stage, frames, candidates, rasterizer, clock=clock)
    tolerance = coarsest_tolerance(
        lambda tolerance, frame: want.margin(trial(tolerance, frame).value) >= 0, candidates, probes, checks
    )
    tried = tuple(sorted([*probes, *checks]))
    worst = min((trial(tolerance or 0.0, frame) for frame in tried), key=lambda made: want.margin(made.value))
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


def coarsest_tolerance(
    is_good_on: Callable[[float, int], bool], candidates: Sequence[float], probes: Sequence[int], checks: Sequence[int]
) -> float | None:
    """Return the coarsest tolerance that is good enough on the probes and then on the checks, or None.

    is_good_on: returns whether a tolerance is good enough on a frame. The frames after one that is not are not tried.
    A check that is not good enough becomes a probe, and the search continues from there to finer tolerances.
    """
    worst_first = list(probes)

    def first_bad(tolerance: float, frames: Sequence[int]) -> int | None:
        return next((frame for frame in frames if not is_good_on(tolerance, frame)), None)

    def is_good(tolerance: float) -> bool:
        bad = first_bad(tolerance, worst_first)
        if bad is not None:  # it will probably fail again
            worst_first.remove(bad)
            worst_first.insert(0, bad)
        return bad is None

    while True:
        tolerance = find_coarsest_passing(is_good, candidates)
        bad = None if tolerance is None else first_bad(tolerance, checks)
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
