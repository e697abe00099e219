"""Find tolerances along a film at which its frames are as exact as wanted, by trial pictures and exact rays.

Each key frame gets the coarsest tolerance at which it is good enough by some standard deviations of what its rays say.
Frames between two of them get a tolerance between theirs. A frame half-way is tried: where it falls short it becomes a
key frame, too. All of it is decided before the film is drawn, so whoever draws a frame draws the same bytes.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

from renderer.draw import Rasterizer
from renderer.film import typical_tolerance
from renderer.frame import Clock, ScheduleController, Stage, make_primitive, render_frames
from renderer.probes import ErrorSamples, ExactPixels, FrameProber, psnr
from renderer.scene import MetricTarget, with_tolerance
from renderer.study.tolerance_search import Trial, distinct_tolerances, two_digit_numbers
from renderer.study.truths import spread_evenly

# Exact rays of a frame that is tried: its PSNR is then known to about 1 dB.
_NUM_RAYS = 1024
# By how many deviations key frames, and those between them, are to be good enough: nine of ten are, and more.
_MARGIN, _MARGIN_BETWEEN = 1.5, 0.5
# Key frames at first, and the most.
_NUM_KEYS, _MAX_KEYS = 8, 32
# From one tolerance of the ladder to the next, about 1 dB.
_STEP = 1.12


@dataclass(frozen=True)
class FilmTolerances:
    """Tolerances for a film's frames, found for an accuracy.

    by_frame: of each frame; 0 for all where not even that is good enough (`is_reachable`).
    tried: the frames that were tried, ascending. worst: the worst trial at the tolerances that were chosen.
    """

    want: MetricTarget
    by_frame: Mapping[int, float]
    is_reachable: bool
    tried: tuple[int, ...]
    worst: Trial


def find_film_tolerances(
    stage: Stage,
    frames: Sequence[int],
    want: MetricTarget,
    rasterizer: Rasterizer,
    *,
    num_threads: int,
    clock: Clock,
    on_trial: Callable[[Trial], None],
) -> FilmTolerances:
    """Find the tolerances at which frames have the PSNR or RMSE that is wanted; both before rounding.

    stage: with a pyramid for every tolerance. The schedule of its scene is ignored, and so is its overlay, which is no
        error. frames: of the film, ascending. on_trial: called after every picture. None is drawn twice.
    """
    stage = replace(stage, scene=replace(stage.scene, overlay="none"))
    ladder = _tolerance_ladder(stage)
    trials = _Trials(stage, want, rasterizer, ladder, _Drawing(num_threads, clock, on_trial))
    start, last = _first_guess(ladder, want), len(ladder) - 1
    # Films of splats have one tolerance: a new cut for each frame would take longer than to draw it.
    choose = _choose_one_step if stage.bricks is None else _choose_steps
    chosen = choose(trials, frames, start, last)
    failed = [frame for frame, step in chosen.items() if step == last and not trials.is_good(step, frame)]
    worst = min(
        (trials.trial(chosen[frame], frame) for frame in failed or chosen), key=lambda made: want.margin(made.value)
    )
    steps = _steps_by_frame(frames, dict.fromkeys(chosen, last) if failed else chosen)
    by_frame = {frame: ladder[step] for frame, step in steps.items()}
    return FilmTolerances(want, by_frame, not failed, tuple(sorted(chosen)), worst)


def _choose_one_step(trials: _Trials, frames: Sequence[int], start: int, last_step: int) -> dict[int, int]:
    """Return one step, of all frames that were tried; of few where one is not good enough even at the last step."""
    tried: list[int] = []
    step = -1
    for frame in spread_evenly(frames, 2 * _NUM_KEYS, is_loop=False):
        if step < 0 or not trials.is_good(step, frame, _MARGIN):
            step = trials.coarsest_step(frame, start if step < 0 else step)
        tried.append(frame)
        if step == last_step and not trials.is_good(step, frame):
            return {frame: step}
    return dict.fromkeys(tried, step)


def _choose_steps(trials: _Trials, frames: Sequence[int], start: int, last_step: int) -> dict[int, int]:
    """Return a step of each frame that was tried; of few where one is not good enough even at the last step."""
    chosen: dict[int, int] = {}
    keys = spread_evenly(frames, _NUM_KEYS, is_loop=False)
    for frame in keys:
        chosen[frame] = start = trials.coarsest_step(frame, start)
        if start == last_step and not trials.is_good(start, frame):
            return chosen
    gaps, num_keys = list(pairwise(keys)), len(keys)
    while gaps:
        first, last = gaps.pop()
        middle = frames[(bisect_left(frames, first) + bisect_left(frames, last)) // 2]
        if middle == first:
            continue
        chosen[middle] = step = _step_between(chosen, first, last, middle)
        if trials.is_good(step, middle, _MARGIN_BETWEEN):
            continue
        chosen[middle] = trials.coarsest_step(middle, step)
        num_keys += 1
        gaps += [(first, middle), (middle, last)] * (num_keys <= _MAX_KEYS)
    return chosen


def _steps_by_frame(frames: Sequence[int], chosen: Mapping[int, int]) -> dict[int, int]:
    """Return the step of each frame, between those of the frames that were tried."""
    tried = sorted(chosen)
    found = {tried[0]: chosen[tried[0]]}
    for first, last in pairwise(tried):
        found |= {frame: _step_between(chosen, first, last, frame) for frame in frames if first < frame <= last}
    return found


def _step_between(steps: Mapping[int, int], first: int, last: int, frame: int) -> int:
    """Return the step of a frame between two others, rounded to the finer one."""
    return math.ceil(steps[first] + (steps[last] - steps[first]) * (frame - first) / (last - first))


def _tolerance_ladder(stage: Stage) -> list[float]:
    """Return falling tolerances of two digits, which differ by _STEP or a little more; the last is 0."""
    candidates = [*distinct_tolerances(stage.pyramid, make_primitive(stage).work)] or [1.0]  # none where all is empty
    found = candidates[:1]
    for tolerance in two_digit_numbers(candidates[0], candidates[-1]):
        if found[-1] >= _STEP * tolerance:
            found.append(tolerance)
    return [*found, 0.0]


def _first_guess(ladder: Sequence[float], want: MetricTarget) -> int:
    """Return the step of a tolerance that has this accuracy with many scans."""
    decibels = want.value if want.metric == "psnr" else psnr(want.value**2)
    return min(bisect_left(ladder, -typical_tolerance(decibels), key=lambda each: -each), len(ladder) - 1)


@dataclass(frozen=True)
class _Drawing:
    """A way to draw trial pictures, and to report them."""

    num_threads: int
    clock: Clock
    on_trial: Callable[[Trial], None]


class _Trials:
    """Trial pictures of frames at the steps of a ladder of tolerances."""

    def __init__(
        self, stage: Stage, want: MetricTarget, rasterizer: Rasterizer, ladder: Sequence[float], drawing: _Drawing
    ) -> None:
        self._stage, self._want, self._rasterizer = stage, want, rasterizer
        self._ladder, self._drawing = ladder, drawing
        self._prober = FrameProber(stage, _NUM_RAYS, num_threads=drawing.num_threads)
        self._exact: dict[int, ExactPixels] = {}  # by frame
        self._made: dict[tuple[int, int], tuple[Trial, ErrorSamples]] = {}  # by step and frame
        self._controller_at = lru_cache(maxsize=1)(self._make_controller)  # has a level of detail in memory

    def trial(self, step: int, frame: int) -> Trial:
        """Return the trial of a frame at a step."""
        return self._draw(step, frame)[0]

    def is_good(self, step: int, frame: int, deviations: float = 0.0) -> bool:
        """Return whether a frame is as exact as wanted, even if the estimate is too good by some deviations."""
        samples = self._draw(step, frame)[1]
        return self._want.margin(self._value(samples.mean * math.exp(deviations * samples.deviation))) >= 0

    def coarsest_step(self, frame: int, start: int) -> int:
        """Return the coarsest step near `start` that is surely good enough; the last one if none is."""
        last = len(self._ladder) - 1

        def is_sure(step: int) -> bool:
            return step == last or self.is_good(step, frame, _MARGIN)

        bad, good, stride = -1, start, 1
        while not is_sure(good):
            bad, good, stride = good, min(good + stride, last), 2 * stride
        stride = 1
        while bad < 0 and good > 0:
            coarser = max(good - stride, 0)
            bad, good = (-1, coarser) if is_sure(coarser) else (coarser, good)
            stride *= 2
        return bisect_left(range(good), True, bad + 1, good, key=is_sure)

    def _draw(self, step: int, number: int) -> tuple[Trial, ErrorSamples]:
        if (step, number) not in self._made:
            tolerance = self._ladder[step]
            stage, controller = self._controller_at(tolerance)
            clock = self._drawing.clock
            (frame,) = render_frames(stage, [number], self._rasterizer, clock=clock, controller=controller)
            if number not in self._exact:
                self._exact[number] = self._prober.exact_pixels(number, frame.image)
            samples = self._exact[number].compare_radiance(frame.radiance).samples
            trial = Trial(tolerance, number, self._value(samples.mean), frame.num_cells)
            self._made[step, number] = trial, samples
            self._drawing.on_trial(trial)
        return self._made[step, number]

    def _value(self, mean_squared_error: float) -> float:
        return psnr(mean_squared_error) if self._want.metric == "psnr" else math.sqrt(mean_squared_error)

    def _make_controller(self, tolerance: float) -> tuple[Stage, ScheduleController]:
        at_tolerance = replace(self._stage, scene=with_tolerance(self._stage.scene, tolerance))
        return at_tolerance, ScheduleController(at_tolerance)
