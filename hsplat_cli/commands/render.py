"""Run `hsplat render SCENE`: render a film or numbered frames, and a sidecar that records how."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from hsplat_cli.commands.options import (
    frames_option,
    no_paths_option,
    quiet_option,
    scene_argument,
    set_option,
    volume_option,
)
from hsplat_cli.executors import ExecutorSpec, executor_options, require_executor, require_executor_for
from hsplat_cli.scenes import load_job
from hsplat_cli.terminal import Reporter, parse_duration, sigterm_as_interrupt
from renderer.errors import InputError


@click.command()
@scene_argument
@set_option()
@click.option("--output", metavar="FILE", help="Write to this .mp4, .gif, {frame}.png or, for one, .png.")
@frames_option(help="Draw only these frames, as a Python slice: 0:30, ::10, 7, -1.")
@volume_option()
@no_paths_option()
@click.option("--progressive", is_flag=True, help="Draw a coarse film first, then finer ones in its place.")
@click.option("--time-limit", metavar="TIME", help="With --progressive: refine no longer than 90s, 10m or 1h30m.")
@click.option("--best-effort", is_flag=True, help="Exit with 0 even if less than what was requested is reached.")
@executor_options
@click.option("--force", is_flag=True, help="Draw again what is finished.")
@quiet_option()
def render(
    scene: Path,
    overrides: tuple[str, ...],
    output: str | None,
    frames: str | None,
    volume: Path | None,
    no_paths: tuple[str, ...],
    progressive: bool,
    time_limit: str | None,
    best_effort: bool,
    workers: int | None,
    scheduler: str | None,
    force: bool,
    reporter: Reporter,
) -> None:
    """Render a scene to a film or to numbered frames.

    SCENE is a YAML file. A JSON file beside the output records how it was made; given in place of SCENE, it makes the
    same film again.
    """
    executor = ExecutorSpec(workers, scheduler)
    require_executor(executor)
    draws: Literal["passes", "film"] = "passes" if progressive else "film"
    overrides = (*overrides, *no_paths)
    job = load_job(scene, overrides=overrides, frames=frames, volume=volume, output=output, draws=draws)
    limit = None if time_limit is None else parse_duration(time_limit, where="--time-limit")
    if limit is not None and not progressive:
        raise InputError("of no use without --progressive", where="--time-limit", hint="error.seconds limits a frame")
    require_executor_for(executor, job.scene, progressive=progressive)
    with sigterm_as_interrupt():
        # Imported here to keep --help fast.
        from hsplat_cli.films import Refinement, render_film

        reporter.announce_compilation()
        refinement = Refinement(limit, best_effort) if progressive else None
        shortfall = render_film(job, executor, reporter, refinement=refinement, force=force).shortfall
    if shortfall is not None:
        if not best_effort:
            raise shortfall
        reporter.note(f"{shortfall.what}: {shortfall.got}, not {shortfall.expected}")
