"""Search for the coarsest tolerances at which frames are as exact as wanted, by trial pictures.

A tolerance counts as good enough for a frame if its estimated error, plus some standard deviations of the estimate, is
small enough. Either all frames get one tolerance, or each frame gets its own: then key frames get the coarsest
tolerance that is good enough, and frames between two key frames get tolerances in between. The frame half-way between
two key frames is tried: if its tolerance is not good enough, it becomes a key frame, too. Everything is decided before
the film is drawn, so that a frame has the same bytes in every process.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import pairwise

from renderer.accuracy.decibels import psnr, wanted_error
from renderer.accuracy.encoding import typical_tolerance
from renderer.accuracy.references import Reference
from renderer.accuracy.tolerances import tolerance_ladder
from renderer.accuracy.truths import spread_evenly
from renderer.draw import Rasterizer
from renderer.errors import RenderError
from renderer.frame import Clock, FilmStage, Frame, ScheduleController, make_primitive, render_frames
from renderer.scene import AnnotationSpec, FilmScene, MetricTarget, counted, with_tolerance

# A key frame counts as good enough if its estimated error plus this many standard deviations is small enough. With it,
# more than nine of ten frames are. With the upper end of the interval in its place, films are 2 to 5 dB better than
# asked for, in place of 1.6 dB.
_MARGIN = 1.5
# A frame between two key frames counts as good enough if its estimated error plus this many standard deviations is
# small enough.
_MARGIN_BETWEEN = 0.5
# The number of key frames with which the search begins.
_NUM_KEYS = 8
# Beyond this number of key frames, the frames between a new key frame and its neighbours are not tried any more.
_MAX_KEYS = 32

# Words on the limit of accuracy at tolerance 0, by whether the scene has no `light`.
_LIMITS = {
    True: "docs/footprints.md says what limits it",
    False: "light is found on a grid of its own, which no tolerance makes finer",
}


@dataclass(frozen=True)
class Trial:
    """A trial picture of a frame at a tolerance.

    value: the value of the metric. num_cells: the number of cells in the cut.
    deviation: the standard deviation of the mean squared error if it is an estimate; otherwise 0.
    """

    tolerance: float
    frame: int
    value: float
    num_cells: int
    deviation: float = 0.0

    def text(self, want: MetricTarget, noun: str) -> str:
        """Return `tolerance 0.1: psnr 44.20 dB on frame 3, 190 bricks`."""
        cells = counted(self.num_cells, noun)
        return f"tolerance {self.tolerance:g}: {want.format(self.value)} on frame {self.frame}, {cells}"


@dataclass(frozen=True)
class FoundTolerances:
    """The tolerances that were found for an accuracy.

    want: the accuracy.
    by_frame: the tolerance of each frame; 0 for all frames if the accuracy is not reachable.
    is_reachable: whether tolerance 0 is good enough for all frames that were tried.
    tried: the frames that were tried, ascending.
    worst: the trial with the worst value at the tolerances that were chosen.
    """

    want: MetricTarget
    by_frame: Mapping[int, float]
    is_reachable: bool
    tried: tuple[int, ...]
    worst: Trial

    def shortfall(self, scene: FilmScene, *, where: str, hint: str) -> RenderError:
        """Return the error for an accuracy that no tolerance reaches. where: the place of the error. hint: a remedy."""
        level, worst = scene.error.finest_level, self.worst
        drawn = counted(worst.num_cells, scene.primitive_name)
        limit = f"error.finest_level: {level} lets no cell be smaller" if level else _LIMITS[scene.at(0).light is None]
        return RenderError(
            "the requested accuracy is beyond full resolution",
            where=where,
            got=f"{self.want.format(worst.value)} on frame {worst.frame}, with {drawn} at tolerance 0",
            expected=str(self.want),
            hint=f"{hint}; {limit}",
        )


def find_tolerances(
    stage: FilmStage,
    frames: Sequence[int],
    reference: Reference,
    rasterizer: Rasterizer,
    *,
    is_constant: bool,
    clock: Clock,
    on_trial: Callable[[Trial], None],
) -> FoundTolerances:
    """Find the coarsest tolerances at which frames, before rounding, are as near to a reference as wanted.

    stage: a stage with a pyramid for every tolerance. The schedule of its scene is ignored, and so is its annotation,
        which is no error.
    frames: the numbers of the frames, ascending.
    is_constant: whether all frames get the same tolerance.
    on_trial: called after every trial picture. No picture is drawn twice.
    """
    bare = stage.scene.changed(lambda scene: replace(scene, annotation=AnnotationSpec()))
    stage = replace(stage, scene=bare)

    @lru_cache(maxsize=1)  # only one, because each has a level of detail in memory
    def controller_at(tolerance: float) -> tuple[FilmStage, ScheduleController]:
        at_tolerance = replace(stage, scene=with_tolerance(stage.scene, tolerance))
        return at_tolerance, ScheduleController(at_tolerance)

    def draw(tolerance: float, number: int) -> Frame:
        at_tolerance, controller = controller_at(tolerance)
        (frame,) = render_frames(at_tolerance, [number], rasterizer, clock=clock, controller=controller)
        return frame

    ladder = tolerance_ladder(stage.largest_error, make_primitive(stage.first).work, reference.step)
    trials = _Trials(ladder, reference, draw, on_trial)
    guess = typical_tolerance(psnr(wanted_error(reference.want)))  # the search begins at a typical tolerance
    start = min(bisect_left(ladder, -guess, key=lambda each: -each), len(ladder) - 1)
    if is_constant:
        chosen = _choose_one_step(trials, spread_evenly(frames, reference.num_frames, is_loop=False), start)
    else:
        chosen = _choose_steps(trials, frames, start)
    failed = [frame for frame, step in chosen.items() if not trials.is_possible(step, frame)]
    made = (trials.trial(chosen[frame], frame) for frame in failed or chosen)
    worst = min(made, key=lambda each: reference.want.margin(each.value))
    steps = dict.fromkeys(frames, trials.last) if failed else _steps_by_frame(frames, chosen)
    by_frame = {frame: ladder[step] for frame, step in steps.items()}
    return FoundTolerances(reference.want, by_frame, not failed, tuple(sorted(chosen)), worst)


def _choose_one_step(trials: _Trials, frames: Sequence[int], start: int) -> dict[int, int]:
    """Return one step of the ladder for all frames to try, by frame.

    If a frame is not good enough even at the last step, only this frame is returned. A finer step need not be more
    exact: frames that were good enough at a coarser step are tried again at a finer one.
    """
    step, before = trials.coarsest_step(frames[0], start), -1
    while step != before:
        before = step
        for frame in frames:
            if not trials.is_sure(step, frame):
                step = trials.coarsest_step(frame, step)
            if not trials.is_possible(step, frame):
                return {frame: step}
    return dict.fromkeys(frames, step)


def _choose_steps(trials: _Trials, frames: Sequence[int], start: int) -> dict[int, int]:
    """Return a step of the ladder for each frame that is tried.

    The search ends, with the frames so far, at a frame that is not good enough even at the last step.
    """
    chosen: dict[int, int] = {}
    keys = spread_evenly(frames, _NUM_KEYS, is_loop=False)
    for frame in keys:
        chosen[frame] = start = trials.coarsest_step(frame, start)
        if not trials.is_possible(start, frame):
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
    """Return the step of each frame, interpolated between the steps of the frames that were tried."""
    tried = sorted(chosen)
    found = {tried[0]: chosen[tried[0]]}
    for first, last in pairwise(tried):
        found |= {frame: _step_between(chosen, first, last, frame) for frame in frames if first < frame <= last}
    return found


def _step_between(steps: Mapping[int, int], first: int, last: int, frame: int) -> int:
    """Return the step of a frame between two others, interpolated linearly and rounded to the finer step."""
    return math.ceil(steps[first] + (steps[last] - steps[first]) * (frame - first) / (last - first))


@dataclass
class _Trials:
    """The trial pictures of a search: frames at the steps of a ladder of falling tolerances.

    draw: a function that draws a frame at a tolerance. made: the trials so far.
    """

    ladder: Sequence[float]
    reference: Reference
    draw: Callable[[float, int], Frame]
    on_trial: Callable[[Trial], None]
    made: dict[tuple[int, int], Trial] = field(default_factory=dict)  # the trials by step and frame

    @property
    def last(self) -> int:
        """Return the number of the last step of the ladder, tolerance 0."""
        return len(self.ladder) - 1

    def trial(self, step: int, number: int) -> Trial:
        """Return the trial of a frame at a step, which is drawn if it is not there yet."""
        if (step, number) not in self.made:
            frame = self.draw(self.ladder[step], number)
            value, deviation = self.reference.compare(frame)
            self.made[step, number] = Trial(self.ladder[step], number, value, frame.num_cells, deviation)
            self.on_trial(self.made[step, number])
        return self.made[step, number]

    def is_good(self, step: int, frame: int, deviations: float = 0.0) -> bool:
        """Return whether a frame is as exact as wanted, even if its error is larger by some standard deviations."""
        want, trial = self.reference.want, self.trial(step, frame)
        if trial.deviation == 0.0:
            return want.margin(trial.value) >= 0
        error = wanted_error(replace(want, value=trial.value)) + deviations * trial.deviation
        return want.margin(psnr(error) if want.metric == "psnr" else math.sqrt(error)) >= 0

    def is_sure(self, step: int, frame: int) -> bool:
        """Return whether a frame is surely good enough at a step; the last step always counts, as no step is finer."""
        return step == self.last or self.is_good(step, frame, _MARGIN)

    def is_possible(self, step: int, frame: int) -> bool:
        """Return whether a frame is good enough at a step, or may be at a finer one."""
        return step < self.last or self.is_good(step, frame)

    def coarsest_step(self, frame: int, start: int) -> int:
        """Return the coarsest step near `start` that is surely good enough; the last one if none is."""
        bad, good, stride = -1, start, 1
        while not self.is_sure(good, frame):
            bad, good, stride = good, min(good + stride, self.last), 2 * stride
        stride = 1
        while bad < 0 and good > 0:
            coarser = max(good - stride, 0)
            bad, good = (-1, coarser) if self.is_sure(coarser, frame) else (coarser, good)
            stride *= 2
        return bisect_left(range(good), True, bad + 1, good, key=lambda step: self.is_sure(step, frame))
