"""`hsplat render SCENE`: a film or numbered frames, and a sidecar that says how they were made."""

from __future__ import annotations

import time
from pathlib import Path

import click

from hsplat_cli.first_run import tell_first_run
from hsplat_cli.interrupts import terminated_as_interrupted
from hsplat_cli.job import Job, load_job
from renderer.output_files import sidecar_path


@click.command()
@click.argument("scene", type=click.Path(path_type=Path))
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value: --set error.tolerance=0.2"
)
@click.option(
    "--output", type=click.Path(path_type=Path), metavar="FILE", help="Write to this .mp4, .gif or {frame}.png."
)
@click.option("--frames", metavar="A:B:STEP", help="Draw only these frames, as Python slices them: 0:30, ::10, 7.")
@click.option("--volume", type=click.Path(path_type=Path), metavar="FILE", help="Take the volume from this file.")
@click.option("--best-effort", is_flag=True, help="Exit with 0 even where less than what was asked for can be had.")
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
def render(
    scene: Path,
    overrides: tuple[str, ...],
    output: Path | None,
    frames: str | None,
    volume: Path | None,
    best_effort: bool,
    quiet: bool,
) -> None:
    """Render a scene to a film or to numbered frames.

    SCENE is a YAML file. Beside the output comes a JSON file that says how it was made.
    """
    job = load_job(scene, overrides=overrides, frames=frames, volume=volume, output=output)
    with terminated_as_interrupted():
        _render(job, best_effort=best_effort, quiet=quiet)


def _render(job: Job, *, best_effort: bool, quiet: bool) -> None:
    # Imported here: numpy, numba and GL take longer to load than --help may take to answer.
    from hsplat_cli.render.film import Done, draw_film, prepare_job, publish  # noqa: PLC0415
    from hsplat_cli.render.goals import make_plan  # noqa: PLC0415
    from renderer.film import open_film  # noqa: PLC0415
    from renderer.raster_gl import GLRasterizer  # noqa: PLC0415
    from renderer.staging import require_writable  # noqa: PLC0415

    tell_first_run(quiet=quiet)
    output, start = job.scene.output, time.perf_counter()
    # What can fail early does: the outputs and the GL context are tried before a voxel is read.
    with open_film(output, job.frames) as film, GLRasterizer() as rasterizer:
        require_writable(sidecar_path(output.file))
        plan = make_plan(prepare_job(job), job.frames, rasterizer, quiet=quiet)
        frames = draw_film(plan, job.frames, film, rasterizer, label=output.file.name, quiet=quiet)
        made_by = rasterizer.renderer_name
    done = Done(job, plan, frames, film.notes, made_by, time.perf_counter() - start)
    publish(done, quiet=quiet)
    shortfall = done.shortfall
    if shortfall is not None and not best_effort:
        raise shortfall
    if shortfall is not None and not quiet:
        click.echo(f"note: {shortfall.what}: {shortfall.got}, not {shortfall.expected}")
