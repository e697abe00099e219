"""Finds the coarsest tolerance that reaches an accuracy (`hsplat measure --want psnr=38`)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from hsplat_cli.terminal import FilmEvents, Reporter
from renderer.accuracy import (
    SSIM_WINDOW_PX,
    TRUTH_TOLERANCE,
    ExactPictures,
    ExactRays,
    FoundTolerances,
    Reference,
    Trial,
    Truth,
    compute_truth,
    find_tolerances,
    require_measuring_packages,
)
from renderer.draw import open_rasterizer
from renderer.errors import InputError
from renderer.frame import FilmStage, prepare_stage, read_film_volumes
from renderer.scene import FilmScene, MetricTarget, counted
from renderer.system import num_cores
from renderer.volume import Volume


def open_at_any_tolerance(scene: FilmScene, volumes: Sequence[Volume]) -> FilmStage:
    """Prepare a stage of the scene and its volumes that can draw at any tolerance."""
    return prepare_stage(scene, clock=time.perf_counter, num_threads=num_cores(), volumes=volumes, any_tolerance=True)


def print_tolerance(
    scene: FilmScene, want: MetricTarget, numbers: Sequence[int], truth_tolerance: float | None, reporter: Reporter
) -> None:
    """Print the coarsest tolerance that reaches an accuracy; the last line can be copied into the scene file.

    numbers: the frames on which the accuracy must be reached. truth_tolerance: the tolerance of whole exact pictures;
    None to compare with a few exact rays of each frame, if they can measure the metric. Raises RenderError if full
    resolution is not accurate enough.
    """
    _require_measurable(scene, want)
    noun = scene.primitive_name
    with (
        open_rasterizer(scene) as rasterizer,
        open_at_any_tolerance(scene, read_film_volumes(scene).first) as stage,
        FilmEvents(reporter, noun) as events,
    ):
        exact: Reference
        if truth_tolerance is None and want.metric in ("psnr", "rmse"):
            exact = ExactRays(stage, want, num_threads=num_cores())
        else:
            exact = ExactPictures(want, partial(find_truth, stage, truth_tolerance or TRUTH_TOLERANCE, events))

        def tell(trial: Trial) -> None:
            events.note(trial.text(want, noun))

        clock = time.perf_counter
        found = find_tolerances(stage, numbers, exact, rasterizer, is_constant=True, clock=clock, on_trial=tell)
    if not exact.shows_volume:
        raise nothing_visible_error(len(found.tried))
    if not found.is_reachable:
        raise found.shortfall(scene, where=f"--want {want.metric}={want.value:g}", hint="want less")
    reporter.result(f"# {_comment(found, noun)}")
    reporter.result(_line(scene, found.worst.tolerance))


def find_truth(stage: FilmStage, tolerance: float, events: FilmEvents, frame: int) -> Truth:
    """Compute the exact picture of a frame, and show the progress of the computation."""
    tell, start = partial(events.truth_progressed, frame), time.perf_counter()
    truth = compute_truth(stage, frame, tolerance, num_threads=num_cores(), on_progress=tell)
    return replace(truth, seconds=time.perf_counter() - start)


def nothing_visible_error(num_frames: int) -> InputError:
    """Return the error for a scene whose frames show nothing of its volume."""
    return InputError(
        "the scene draws nothing, so there is nothing to measure",
        got=f"{num_frames} frame{'s' * (num_frames > 1)} without anything of the volume",
        expected="a volume in view, and a transfer function that shows some of it",
        hint="`hsplat info` shows which values there are",
    )


def _comment(found: FoundTolerances, noun: str) -> str:
    """Describe the accuracy at the tolerance that was found, and the number of bricks or splats."""
    worst, frames = found.worst, ", ".join(map(str, found.tried))
    drawn, value = counted(worst.num_cells, noun), found.want.format(worst.value)
    if len(found.tried) == 1:
        return f"{value} on frame {frames}; {drawn}"
    return f"{value} or better on the frames {frames}; {drawn}; frame {worst.frame} is the worst"


def _require_measurable(scene: FilmScene, want: MetricTarget) -> None:
    if want.metric in ("ssim", "flip"):
        require_measuring_packages()
    if want.metric == "ssim" and min(scene.output.size) < SSIM_WINDOW_PX:
        raise InputError(
            "the picture is too small for SSIM",
            where="output.size",
            got=" x ".join(map(str, scene.output.size)),
            expected=f"at least {SSIM_WINDOW_PX} pixels each way",
            hint="want a psnr, rmse or flip",
        )


def _line(scene: FilmScene, tolerance: float) -> str:
    """Return the section `error` for the scene file, on one line."""
    error = scene.error
    parts = [f"measure: {error.measure}"]
    parts += [f"of: {error.of}"] if error.of != "classified" else []
    parts += [f"finest_level: {error.finest_level}"] if error.finest_level else []
    return f"error: {{{', '.join([*parts, f'tolerance: {tolerance:g}'])}}}"
