"""`hsplat measure --want psnr=38`: the coarsest tolerance that is good enough, as a line for the scene file."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import click

from hsplat_cli.first_run import tell_first_run
from hsplat_cli.measure.options import Want
from hsplat_cli.measure.stage import prepared
from hsplat_cli.measure.truth import find_truths, require_something
from renderer.drawing import Stage
from renderer.errors import InputError, RenderError
from renderer.metrics import SSIM_WINDOW_PX, require_measuring_packages
from renderer.raster_gl import GLRasterizer
from renderer.readers import read_volume
from renderer.scene import Scene
from renderer.sweep import num_cells_at
from renderer.tolerances import distinct_rungs
from renderer.trials import Trial, Trials, coarsest_tolerance
from renderer.truths import Truth, extreme_frames, is_loop, spread_frames

# Frames that are probed, besides those with the smallest and the largest picture; as many lie between them as a check.
_NUM_PROBES = 4
# Of a long path, only so many frames are looked at for the smallest and the largest picture.
_MOST_LOOKED_AT = 120
# Cells of the coarse cut that is drawn to look at them.
_COARSE_CELLS = 4000


def find_wanted(scene: Scene, want: Want, numbers: Sequence[int], truth_tolerance: float, *, quiet: bool) -> None:
    """Search, and print the line. Raises RenderError where full resolution does not reach what is wanted."""
    _require_measurable(scene, want)
    tell_first_run(quiet=quiet)
    with GLRasterizer() as rasterizer:
        stage = prepared(scene, read_volume(scene.volume))
        rungs = list(distinct_rungs(stage.pyramid, lambda tolerance: num_cells_at(stage, tolerance)))
        probes, checks = _frames_to_try(stage, numbers, rungs, rasterizer)
        truth_of = _truths(stage, truth_tolerance, quiet=quiet)
        require_something([truth_of(probes[0])])
        trials = Trials(
            stage,
            rasterizer,
            metric=want.name,
            margin=want.margin,
            truth_of=truth_of,
            clock=time.perf_counter,
            on_trial=_teller(want, quiet=quiet),
        )
        tolerance = coarsest_tolerance(trials, rungs, probes, checks)
        tried = [*probes, *checks]
        worst = trials.worst(tolerance or 0.0, tried)
    if tolerance is None:
        raise RenderError(
            "the accuracy that is wanted is beyond full resolution",
            where=f"--want {want.name}={want.value:g}",
            got=f"{want.of(worst.value)} on frame {worst.frame}, with {worst.num_cells} splats at tolerance 0",
            expected=str(want),
            hint="want less; what limits it is told in docs/accuracy.md",
        )
    click.echo(_line(scene, tolerance))
    click.echo(
        f"# {want.of(worst.value)} or better on the frames {', '.join(map(str, sorted(tried)))}; "
        f"{_cells(worst)}; frame {worst.frame} is the worst"
    )


def _require_measurable(scene: Scene, want: Want) -> None:
    if want.name in ("ssim", "flip"):
        require_measuring_packages()
    if want.name == "ssim" and min(scene.output.size) < SSIM_WINDOW_PX:
        raise InputError(
            "the picture is too small for SSIM",
            where="output.size",
            got=" x ".join(map(str, scene.output.size)),
            expected=f"at least {SSIM_WINDOW_PX} pixels each way",
            hint="want a psnr, rmse or flip",
        )


def _frames_to_try(
    stage: Stage, numbers: Sequence[int], rungs: Sequence[float], rasterizer: GLRasterizer
) -> tuple[list[int], list[int]]:
    """Probes: the largest picture first, for it is usually the worst; and checks, half-way between the spread ones."""
    path = stage.scene.camera.path
    closed = is_loop(path) and len(numbers) == path.frames
    between = spread_frames(numbers, 2 * _NUM_PROBES, is_loop=closed)
    looked_at = spread_frames(numbers, _MOST_LOOKED_AT, is_loop=closed)
    coarse = next((rung for rung in rungs if num_cells_at(stage, rung) >= _COARSE_CELLS), 0.0)
    smallest, largest = extreme_frames(stage, looked_at, coarse, rasterizer, clock=time.perf_counter)
    probes = list(dict.fromkeys([largest, *between[::2], smallest]))
    return probes, [frame for frame in between[1::2] if frame not in probes]


def _truths(stage: Stage, tolerance: float, *, quiet: bool) -> Callable[[int], Truth]:
    """The truth of a frame, found when it is first asked for."""
    found: dict[int, Truth] = {}

    def truth_of(frame: int) -> Truth:
        if frame not in found:
            (truth,), _ = find_truths(stage, [frame], tolerance, quiet=quiet)
            found[frame] = truth
        return found[frame]

    return truth_of


def _teller(want: Want, *, quiet: bool) -> Callable[[Trial], None]:
    def tell(trial: Trial) -> None:
        if not quiet:
            what = f"tolerance {trial.tolerance:g}: {want.of(trial.value)} on frame {trial.frame}"
            click.echo(f"{what}, {_cells(trial)}", err=True)

    return tell


def _cells(trial: Trial) -> str:
    return "1 cell" if trial.num_cells == 1 else f"{trial.num_cells} cells"


def _line(scene: Scene, tolerance: float) -> str:
    """The section of the scene file, in one line."""
    error = scene.error
    parts = [f"measure: {error.measure}"]
    parts += [f"of: {error.of}"] if error.of != "classified" else []
    parts += [f"finest_level: {error.finest_level}"] if error.finest_level else []
    return f"error: {{{', '.join([*parts, f'tolerance: {tolerance:g}'])}}}"
