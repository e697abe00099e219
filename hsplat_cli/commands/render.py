"""Run `hsplat render SCENE`: render a film or numbered frames, and a sidecar that records how they were made."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import click

from hsplat_cli.commands.shared_options import FRAMES_WORDS, quiet_option, takes_scene
from hsplat_cli.executors import ExecutorSpec, executor_options, require_scheduler, require_untimed
from hsplat_cli.scenes import SceneRequest, load_job
from hsplat_cli.terminal import FilmEvents, Reporter, parse_duration, report_film
from renderer.errors import InputError


@click.command()
@takes_scene(f"Draw only these frames: {FRAMES_WORDS}")
@click.option("--output", metavar="FILE", help="Write to this film, {frame}.png or, for one, .png.")
@click.option("--progressive", is_flag=True, help="Draw a coarse film first, then finer ones in its place.")
@click.option("--time-limit", metavar="TIME", help="With --progressive: refine no longer than 90s, 10m or 1h30m.")
@click.option("--best-effort", is_flag=True, help="Exit with 0 even if the requested accuracy is not reached.")
@executor_options
@click.option("--force", is_flag=True, help="Draw again, even if frames or the film are finished.")
@quiet_option()
def render(
    request: SceneRequest,
    *,
    output: str | None,
    progressive: bool,
    time_limit: str | None,
    best_effort: bool,
    executor: ExecutorSpec,
    force: bool,
    reporter: Reporter,
) -> None:
    """Render a scene to a film or to numbered frames.

    SCENE is a YAML file. A JSON file beside the output records how it was made; given in place of SCENE, it makes the
    same film again.
    """
    require_scheduler(executor.scheduler)
    job = load_job(replace(request, output=output), "passes" if progressive else "film")
    limit = None if time_limit is None else parse_duration(time_limit, where="--time-limit")
    if limit is not None and not progressive:
        raise InputError("of no use without --progressive", where="--time-limit", hint="error.seconds limits a frame")
    require_untimed(executor.scheduler, job.scene, progressive=progressive)
    # Imported here to keep --help fast.
    from hsplat_cli.executors import open_executor
    from renderer.job import Refinement, make_film, one_pass

    passes = Refinement(math.inf if limit is None else limit, best_effort) if progressive else one_pass
    with FilmEvents(reporter, job.scene.primitive_name) as events:
        result = make_film(job, partial(open_executor, executor, reporter), passes, events, resumes=not force)
    report_film(result, reporter)
    if result.shortfall is not None:
        if not best_effort:
            raise result.shortfall
        reporter.note(f"{result.shortfall.what}: {result.shortfall.got}, not {result.shortfall.expected}")
