"""Measures the cost and the accuracy of a film at each of many settings, and plans the settings to measure.

Every setting is drawn by the loop that makes films. A first pass over the frames warms up shaders, buffers and caches,
and gives the pictures; the passes after it are timed.
"""

from __future__ import annotations

import statistics
from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np

from hsplat_cli.measure.thumbnails import amplified_difference, thumbnail
from hsplat_cli.terminal import Machine
from renderer.accuracy import (
    Accuracy,
    Flicker,
    FloatImage,
    PictureErrors,
    SampledTruth,
    Truth,
    measure_flicker,
    pool_accuracies,
    pool_flickers,
    spread_tolerances,
)
from renderer.draw import Rasterizer
from renderer.frame import Clock, FilmStage, make_primitive, render_frames
from renderer.scene import ErrorSpec, FilmScene, SplatSpec, tolerance_at, with_tolerance
from renderer.system import PeakMemory
from renderer.volume import UInt8

# The most tolerances that are chosen for a footprint and an error measure if the user gives no tolerances.
_MAX_TOLERANCES = 10
# Seconds to draw a cell as a splat, by a software renderer on two cores. Only the ratios of _PER_CELL, _PER_TRIANGLE,
# _PER_SAMPLE and _PER_PICTURE matter: they predict the remaining time.
_PER_CELL = 1e-6
# Seconds to draw a triangle of a Gouraud splat, by a software renderer on two cores.
_PER_TRIANGLE = 1.2e-7
# Seconds to take a sample of a ray in a brick, on two cores.
_PER_SAMPLE = 1e-7
# Seconds that each picture takes on two cores, whatever it shows.
_PER_PICTURE = 0.4
# Names of the steps that are timed for each frame.
FRAME_STEPS = ("order", "draw", "quantize")
# Names of the steps that are timed once for a cut, which many frames may share.
_CUT_STEPS = ("cut", "primitives")
# If the first pass over the frames took longer than this, in seconds, only the first frame is drawn again. Otherwise,
# no new timed pass begins once all timed passes together have taken longer.
_REPEAT_LIMIT_S = 4.0

# The seconds of each step of drawing a frame, by the name of the step.
Seconds = Mapping[str, float]
# The truth of each frame: its whole exact picture, or some exact pixels.
Truths = Sequence[Truth] | Sequence[SampledTruth]


@dataclass(frozen=True)
class Setting:
    """Holds the parameters of one measurement, which is a point on a curve of error over cost.

    series: the name of the curve, whose points differ in their tolerances, such as "gaussian, optical" (footprint and
        error measure) or "gouraud 8x3, rms, uncorrected".
    label: the name of the point, such as "tolerance 0.1".
    options: the parameters by their names in tables: tolerance, footprint, ...
    """

    series: str
    label: str
    options: Mapping[str, str | float | bool]


@dataclass(frozen=True)
class FrameMeasurement:
    """Holds the measurement of one frame at one setting.

    num_primitives: the number of splats or bricks that the frame can show.
    rays_per_pixel: the number of rays divided by the number of pixels; None for splats.
    seconds: for each step, the seconds of each timed repetition.
    accuracy: the accuracy of the frame's picture.
    flicker: the change of errors from the frame before it on the path; None unless both have whole exact pictures.
    """

    frame: int
    num_primitives: int
    rays_per_pixel: float | None
    seconds: Mapping[str, tuple[float, ...]]
    accuracy: Accuracy
    flicker: Flicker | None = None

    @property
    def frame_seconds(self) -> tuple[float, ...]:
        """Return the seconds of the frame for each repetition, summed over all steps."""
        return tuple(map(sum, zip(*self.seconds.values(), strict=True)))


@dataclass(frozen=True)
class Measurement:
    """Holds the measurement of one setting, frame by frame.

    num_cells: the number of cells or bricks in the cut.
    pyramid_seconds: the time to build the pyramid and bricks, once.
    seconds: for each step that runs once for all frames (cut, primitives), the seconds of each repetition.
    frames: the measurements of the frames.
    overall: the accuracy of all frames together.
    peak_bytes: the peak memory of the process; None if the system does not report it.
    picture: uint8 [h, w, 3], a thumbnail of the first frame.
    difference: uint8 [h, w, 3], a thumbnail of the difference of the first frame from its exact picture, times
        DIFFERENCE_GAIN; None if only some pixels are known exactly.
    flicker: the flicker over all pairs of neighbouring frames; None without any pair.
    """

    setting: Setting
    num_cells: int
    pyramid_seconds: float
    seconds: Mapping[str, tuple[float, ...]]
    frames: tuple[FrameMeasurement, ...]
    overall: Accuracy
    peak_bytes: int | None
    picture: UInt8
    difference: UInt8 | None
    flicker: Flicker | None = None

    @property
    def frame_seconds(self) -> float:
        """Return the median time of a frame, over frames and repetitions."""
        return statistics.median(self._all_frame_seconds)

    @property
    def frame_seconds_spread(self) -> tuple[float, float]:
        """Return the first and third quartile of the time of a frame, over frames and repetitions."""
        low, high = np.quantile(self._all_frame_seconds, [0.25, 0.75])
        return float(low), float(high)

    @property
    def num_primitives(self) -> float:
        """Return the mean number of splats or bricks over the frames."""
        return statistics.fmean(sample.num_primitives for sample in self.frames)

    @property
    def rays_per_pixel(self) -> float | None:
        """Return the mean number of rays for each pixel, over the frames; None for splats."""
        found = [sample.rays_per_pixel for sample in self.frames if sample.rays_per_pixel is not None]
        return statistics.fmean(found) if found else None

    @property
    def _all_frame_seconds(self) -> list[float]:
        return [seconds for sample in self.frames for seconds in sample.frame_seconds]


def splat_setting(error: ErrorSpec, splat: SplatSpec) -> Setting:
    """Return the setting of a scene with a constant tolerance. Footprint and error measure give its series the name."""
    footprint = f"gouraud {splat.angular}x{splat.radial}" if splat.footprint == "gouraud" else splat.footprint
    measure = error.measure if error.of == "classified" else f"{error.measure} of {error.of}"
    tolerance = tolerance_at(error, 0)
    options: dict[str, str | float | bool] = {"tolerance": tolerance, "footprint": footprint, "measure": measure}
    words = [footprint, measure]
    if splat.footprint != "integrated":
        words += [] if splat.opacity_correction else ["uncorrected"]
        options["opacity_correction"] = splat.opacity_correction
    return Setting(", ".join(words), f"tolerance {tolerance:g}", options)


def measure_setting(
    stage: FilmStage, truths: Truths, rasterizer: Rasterizer, *, clock: Clock, repeats: int
) -> Measurement:
    """Measure a scene at its constant tolerance and with its footprint, on the frames whose truths are given.

    repeats: the largest number of timed passes. With 0 the first pass is timed, in which the first frame may be slower.
    """
    numbers = [truth.frame for truth in truths]
    accuracies: list[Accuracy] = []
    peaks: list[int] = []
    counts: list[tuple[int, float | None]] = []
    first_pass: list[Seconds] = []
    thumbnails: list[tuple[UInt8, UInt8 | None]] = []
    flickers: list[Flicker | None] = []
    errors: PictureErrors | None = None
    memory = PeakMemory()
    for number, frame in enumerate(render_frames(stage, numbers, rasterizer, clock=clock)):
        truth = truths[number]
        peaks += [peak] if (peak := memory.peak_bytes()) is not None else []
        picture = frame.unrounded
        accuracies.append(truth.accuracy_of(picture))
        before, errors = errors, truth.errors_of(picture) if isinstance(truth, Truth) else None
        flickers.append(measure_flicker(before, errors) if before is not None and errors is not None else None)
        thumbnails += [] if thumbnails else [_thumbnails(picture, truth)]
        counts.append((frame.num_primitives, frame.rays_per_pixel))
        first_pass.append(frame.seconds)
        memory.reset()
    passes = _timed_passes(stage, numbers, rasterizer, clock, repeats, first_pass)
    times = [_repetitions(repetitions, FRAME_STEPS) for repetitions in zip(*passes, strict=True)]
    return Measurement(
        setting=splat_setting(stage.scene.error, stage.first.scene.splat),
        num_cells=frame.num_cells,
        pyramid_seconds=stage.seconds["pyramid"],
        seconds=_repetitions([seconds[0] for seconds in passes], _CUT_STEPS),
        frames=tuple(
            FrameMeasurement(number, *counted, taken, accuracy, flicker)
            for number, counted, taken, accuracy, flicker in zip(
                numbers, counts, times, accuracies, flickers, strict=True
            )
        ),
        overall=pool_accuracies(accuracies),
        peak_bytes=max(peaks, default=None),
        picture=thumbnails[0][0],
        difference=thumbnails[0][1],
        flicker=pool_flickers([each for each in flickers if each is not None]),
    )


def _thumbnails(picture: FloatImage, truth: Truth | SampledTruth) -> tuple[UInt8, UInt8 | None]:
    """Return thumbnails of a frame's picture and of its difference from the truth.

    The difference is None if the truth has only some pixels.
    """
    difference = thumbnail(amplified_difference(picture, truth.picture)) if isinstance(truth, Truth) else None
    return thumbnail(picture), difference


def _timed_passes(
    stage: FilmStage,
    numbers: Sequence[int],
    rasterizer: Rasterizer,
    clock: Clock,
    repeats: int,
    first_pass: list[Seconds],
) -> list[list[Seconds]]:
    """Draw the frames in up to `repeats` passes, and return the seconds of each frame in each pass.

    If `repeats` is 0, the times of the first pass are returned. If the first pass took too long to repeat, only its
    first frame is drawn again: all other frames were drawn after the shaders, buffers and caches had been set up.
    """

    def draw(numbers: Sequence[int]) -> list[Seconds]:
        return [frame.seconds for frame in render_frames(stage, numbers, rasterizer, clock=clock)]

    if repeats == 0:
        return [first_pass]
    if sum(sum(seconds.values()) for seconds in first_pass) > _REPEAT_LIMIT_S:
        return [draw(numbers[:1]) + first_pass[1:]]
    passes: list[list[Seconds]] = []
    start = clock()
    while len(passes) < repeats and (not passes or clock() - start < _REPEAT_LIMIT_S):
        passes.append(draw(numbers))
    return passes


def _repetitions(repetitions: Sequence[Seconds], steps: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Return the seconds of each step in the repetitions of a frame. Steps that do not occur are left out."""
    there = [name for name in steps if all(name in seconds for seconds in repetitions)]
    return {name: tuple(seconds[name] for seconds in repetitions) for name in there}


@dataclass(frozen=True)
class PlannedSetting:
    """Holds a setting to measure.

    scene: the scene with the setting's constant tolerance and footprint. splat: the scene's section `splat`, which has
    the footprint. work: the work of drawing a frame, in cells or samples, from `Primitive.work`.
    """

    scene: FilmScene
    splat: SplatSpec
    work: float

    @property
    def tolerance(self) -> float:
        """Return the tolerance of the setting, the same on all frames."""
        return tolerance_at(self.scene.error, 0)

    def picture_key(self) -> Hashable:
        """Return a key that is equal for settings with equal pictures.

        At tolerance 0 splats are single voxels: neither the error measure nor the opacity correction changes them.
        """
        error, splat = self.scene.error, self.splat
        if self.tolerance == 0 and error.finest_level == 0 and splat.footprint != "integrated":
            return replace(splat, opacity_correction=True)
        return error, splat

    def predicted_seconds(self, num_frames: int, repeats: int) -> float:
        """Estimate the seconds to measure this setting."""
        splat, each = self.splat, _PER_CELL
        if splat.footprint == "gouraud":
            each += _PER_TRIANGLE * splat.angular * (2 * splat.radial - 1)
        elif splat.footprint == "integrated":
            each = _PER_SAMPLE
        pass_seconds = num_frames * self.work * each
        passes = 1 + repeats if pass_seconds * repeats < _REPEAT_LIMIT_S else 1
        return num_frames * _PER_PICTURE + passes * pass_seconds


def plan_sweep(
    scene: FilmScene,
    open_stage: Callable[[FilmScene], AbstractContextManager[FilmStage]],
    errors: Sequence[ErrorSpec],
    splats: Sequence[SplatSpec],
    tolerances: Sequence[float] | None,
) -> list[list[PlannedSetting]]:
    """Plan the settings of a sweep: every error measure, with all footprints, at all tolerances, from coarse to fine.

    Settings that share a pyramid are in one list.

    open_stage: prepares the stage of a scene; called once for each error measure, and once more if both splats and
        bricks are measured.
    errors: the error measures. splats: the footprints.
    tolerances: the tolerances to measure; None to choose tolerances for each pyramid, and to add the scene's own first
        tolerance, if it has one.
    """
    plan = []
    own = scene.error
    for error, kind in product(errors, dict.fromkeys(splat.primitive_name for splat in splats)):
        alike = [splat for splat in splats if splat.primitive_name == kind]
        is_own = (error.measure, error.of) == (own.measure, own.of) and own.goal is None
        with open_stage(_with_setting(scene, error, alike[0])) as stage:
            works = _work_by_tolerance(stage, tolerances, float(tolerance_at(own, 0)) if is_own else None)
        plan.append(
            [
                PlannedSetting(with_tolerance(_with_setting(scene, error, splat), tolerance), splat, work)
                for splat in alike
                for tolerance, work in works.items()
            ]
        )
    return plan


def _with_setting(scene: FilmScene, error: ErrorSpec, splat: SplatSpec) -> FilmScene:
    return scene.changed(lambda each: replace(each, error=error, splat=splat))


def _work_by_tolerance(stage: FilmStage, tolerances: Sequence[float] | None, own: float | None) -> dict[float, float]:
    """Return the tolerances to measure on a stage, from coarse to fine, with the work of drawing at each.

    tolerances: the tolerances to measure; None to choose them. own: the scene's own tolerance, which is added to chosen
    tolerances; None to add none.
    """
    work = cache(make_primitive(stage.first).work)
    if tolerances is None:
        tolerances = spread_tolerances(stage.largest_error, work, _MAX_TOLERANCES)
        tolerances += () if own is None else (own,)
    return {tolerance: work(tolerance) for tolerance in sorted(set(tolerances), reverse=True)}


@dataclass(frozen=True)
class Study:
    """Holds a study with its results.

    name: the name of the scene file.
    scene: the scene with all defaults, from `scene_to_dict`.
    volume: the name, the fingerprint, the dtype and the shape of the volume.
    machine: the machine and the program that measured.
    truth_tolerance: the tolerance with which exact rays were computed.
    truths: the exact pictures of frames; empty if only some pixels are known exactly.
    measurements: the measurements, in the planned order.
    notes: notes for the reader, such as on an interruption.
    """

    name: str
    scene: Mapping[str, Any]
    volume: Mapping[str, object]
    machine: Machine
    truth_tolerance: float
    truths: tuple[Truth, ...]
    measurements: tuple[Measurement, ...]
    notes: tuple[str, ...]
