"""Find the coarsest tolerance that reaches an accuracy (`hsplat measure --want psnr=38`)."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import AbstractContextManager

from hsplat_cli.terminal import FilmEvents, Reporter
from renderer.draw import open_rasterizer
from renderer.errors import InputError
from renderer.frame import Stage, open_stage
from renderer.job import nothing_visible_error, search_tolerance, unreachable_accuracy_error
from renderer.readers import read_volume
from renderer.scene import MetricTarget, Scene, counted
from renderer.study import SSIM_WINDOW_PX, ToleranceSearchResult, require_measuring_packages
from renderer.system import num_cores
from renderer.volume import Volume


def open_at_any_tolerance(scene: Scene, volume: Volume) -> AbstractContextManager[Stage]:
    """Prepare the scene's stage for a volume in memory, at any tolerance."""
    return open_stage(scene, clock=time.perf_counter, num_threads=num_cores(), volume=volume, any_tolerance=True)


def print_tolerance(
    scene: Scene, want: MetricTarget, numbers: Sequence[int], truth_tolerance: float, reporter: Reporter
) -> None:
    """Search, and print a line for the scene file. Raises RenderError if full resolution is not accurate enough."""
    _require_measurable(scene, want)
    with (
        open_rasterizer(scene) as rasterizer,
        open_at_any_tolerance(scene, read_volume(scene.volume)) as stage,
        FilmEvents(reporter, scene.splat.primitive_name) as events,
    ):
        found = search_tolerance(stage, numbers, want, truth_tolerance, rasterizer, events)
    if found.shows_nothing:
        raise nothing_visible_error(len(found.frames))
    if found.tolerance is None:
        where = f"--want {want.metric}={want.value:g}"
        raise unreachable_accuracy_error(want, found.worst, scene, where=where, hint="want less")
    reporter.result(_line(scene, found.tolerance))
    reporter.result(f"# {_comment(found, scene.splat.primitive_name)}")


def _comment(found: ToleranceSearchResult, noun: str) -> str:
    """Describe the accuracy at the tolerance, and the number of bricks or splats."""
    worst, frames = found.worst, ", ".join(map(str, found.frames))
    drawn, value = counted(worst.num_cells, noun), found.want.format(worst.value)
    if len(found.frames) == 1:
        return f"{value} on frame {frames}; {drawn}"
    return f"{value} or better on the frames {frames}; {drawn}; frame {worst.frame} is the worst"


def _require_measurable(scene: Scene, want: MetricTarget) -> None:
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


def _line(scene: Scene, tolerance: float) -> str:
    """Return the section of the scene file, on one line."""
    error = scene.error
    parts = [f"measure: {error.measure}"]
    parts += [f"of: {error.of}"] if error.of != "classified" else []
    parts += [f"finest_level: {error.finest_level}"] if error.finest_level else []
    return f"error: {{{', '.join([*parts, f'tolerance: {tolerance:g}'])}}}"
