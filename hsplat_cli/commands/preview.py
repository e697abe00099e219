"""Run `hsplat preview SCENE|VOLUME`: show a scene, or what is suggested for a volume, on one page."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from hsplat_cli.commands.options import FILE, quiet_option
from hsplat_cli.scenes import (
    SceneRequest,
    base_name,
    film_options,
    load_job,
    suggest_scene,
    volume_options,
    volume_spec,
)
from hsplat_cli.terminal import OutputPath, Reporter
from renderer.errors import InputError
from renderer.film import require_writable_dry_run, write_staged
from renderer.job import volume_files
from renderer.suggest import FilmOptions


@click.command()
@click.argument("source", type=FILE, metavar="SCENE|VOLUME")
@click.option(
    "-o",
    "--output",
    type=OutputPath(dir_okay=False),
    metavar="FILE",
    help="Write to this page.  [default: NAME.html in the current folder]",
)
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value of the scene.")
@click.option("--volume", type=FILE, metavar="FILE", help="Take the volume of a scene from this file.")
@click.option("--watch", "watches", is_flag=True, help="Draw a scene again whenever its file is saved.")
@click.option("--serve", is_flag=True, help="As --watch, on a page of a server for this machine.")
@film_options
@volume_options()
@quiet_option()
def preview(
    *,
    source: Path,
    output: Path | None,
    overrides: tuple[str, ...],
    volume: Path | None,
    watches: bool,
    serve: bool,
    reporter: Reporter,
    **options: Any,
) -> None:
    """Show a scene or a volume on one page, before its film is made.

    SCENE is a YAML file, or the JSON file beside a film; VOLUME a file, or a folder of slices, whose scene is
    suggested. The page needs no network: frames of the film, the object as it turns, histograms with what is seen of
    them, slices, and variants with the lines that make them. The other options are those of turntable, for a VOLUME.
    """
    is_scene = source.suffix.lower() in (".yaml", ".yml", ".json")
    name = base_name(source.with_suffix("") if is_scene else source)
    page = Path(f"{name}.html") if output is None else output
    if is_scene:
        _require_no_options(options)
        request = SceneRequest(source, overrides, volume)
        if watches or serve:
            _watch(request, page, serve=serve, reporter=reporter)
            return
        job = load_job(request, "nothing")
        _require_page(page, job.input_files())
    else:
        if volume is not None:
            raise InputError("this is for a scene", where="--volume", got=f"the volume {source}")
        if watches or serve:
            raise InputError("this is for a scene", where="--watch", got=f"the volume {source}")
        film, spec = FilmOptions.of(options), volume_spec(source, options)
        _require_page(page, chain.from_iterable(map(volume_files, filter(None, (spec, film.under)))))
        scene = Path(f"{name}.yaml")
        text, _ = suggest_scene(spec, film, reporter, scene=scene, output=Path(f"{name}.mp4"))
        job = load_job(SceneRequest(scene, overrides, content=text.encode()), "nothing")
    # Imported here to keep --help fast.
    from hsplat_cli.preview import NUM_PARTS, preview_page

    with reporter.progress([1.0] * NUM_PARTS, label="preview", unit="parts") as bar:
        content = preview_page(job, f"Preview of {source.absolute().name}", bar.advance).encode()
    write_staged(page, content)
    reporter.line(f"page: {page}")


def _watch(request: SceneRequest, page: Path, *, serve: bool, reporter: Reporter) -> None:
    """Show a scene on a page, as long as nobody interrupts that."""
    from hsplat_cli.preview import file_states, served_states, watch

    title = request.path.absolute().name
    with contextlib.suppress(KeyboardInterrupt):
        if serve:
            with served_states(title) as (address, show):
                reporter.line(f"page: {address} (Ctrl-C ends it)")
                watch(request, show)
        _require_page(page, [request.path])
        show = file_states(page, title)
        reporter.line(f"page: {page} (Ctrl-C ends it)")
        watch(request, show)


def _require_no_options(options: Mapping[str, Any]) -> None:
    """Raise InputError for an option of a volume without a scene."""
    context = click.get_current_context()
    for name in options:
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            where, hint = f"--{name.replace('_', '-')}", "--set changes a value of a scene"
            raise InputError("this is for a volume without a scene", where=where, hint=hint)


def _require_page(page: Path, inputs: Iterable[Path]) -> None:
    """Raise InputError unless the page can be written, and is none of the inputs."""
    from hsplat_cli.compare import ReportFiles

    ReportFiles({"--output": page}).require_names(inputs)
    require_writable_dry_run(page)
