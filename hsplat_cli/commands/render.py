"""`hsplat render SCENE`: a film or numbered frames, and a sidecar that says how they were made."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from hsplat_cli.executors import ExecutorSpec, executor_options, require_executor, require_executor_for
from hsplat_cli.scenes import load_job
from hsplat_cli.terminal import Reporter, parse_duration, sigterm_as_interrupt
from renderer.errors import InputError


@click.command()
@click.argument("scene", type=click.Path(path_type=Path))
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value: --set error.tolerance=0.2"
)
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Write to this .mp4, .gif, {frame}.png or, for one frame, .png.",
)
@click.option("--frames", metavar="A:B:STEP", help="Draw only these frames, as Python slices them: 0:30, ::10, 7, -1.")
@click.option("--volume", type=click.Path(path_type=Path), metavar="FILE", help="Take the volume from this file.")
@click.option("--progressive", is_flag=True, help="A coarse film soon, then finer ones in its place.")
@click.option("--time-limit", metavar="TIME", help="With --progressive: refine no longer than 90s, 10m or 1h30m.")
@click.option("--best-effort", is_flag=True, help="Exit with 0 even where less than what was asked for can be had.")
@executor_options
@click.option("--force", is_flag=True, help="Draw again what is there already.")
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
def render(
    scene: Path,
    overrides: tuple[str, ...],
    output: Path | None,
    frames: str | None,
    volume: Path | None,
    progressive: bool,
    time_limit: str | None,
    best_effort: bool,
    workers: int | None,
    scheduler: str | None,
    force: bool,
    quiet: bool,
) -> None:
    """Render a scene to a film or to numbered frames.

    SCENE is a YAML file. Beside the output comes a JSON file that says how it was made; in place of SCENE it makes the
    same again.
    """
    executor = ExecutorSpec(workers, scheduler)
    require_executor(executor)
    draws: Literal["passes", "film"] = "passes" if progressive else "film"
    job = load_job(scene, overrides=overrides, frames=frames, volume=volume, output=output, draws=draws)
    limit = None if time_limit is None else parse_duration(time_limit, where="--time-limit")
    if limit is not None and not progressive:
        raise InputError("of no use without --progressive", where="--time-limit", hint="error.seconds limits a frame")
    require_executor_for(executor, job.scene, progressive=progressive)
    with sigterm_as_interrupt():
        # Imported here: numpy, numba and GL take longer to load than --help may take to answer.
        from hsplat_cli.films import Refinement, render_film

        reporter = Reporter(quiet)
        reporter.announce_compilation()
        refinement = Refinement(limit, best_effort) if progressive else None
        shortfall = render_film(job, executor, reporter, refinement=refinement, force=force).shortfall
    if shortfall is not None:
        if not best_effort:
            raise shortfall
        reporter.note(f"{shortfall.what}: {shortfall.got}, not {shortfall.expected}")
