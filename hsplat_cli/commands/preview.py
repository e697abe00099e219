"""Run `hsplat preview SCENE|VOLUME`: show a scene, or the suggested scene of a volume, on one page."""

from __future__ import annotations

import contextlib
import signal
from dataclasses import fields
from pathlib import Path

import click

from hsplat_cli.commands.shared_options import cache_option, quiet_option, require_none_of
from hsplat_cli.scenes import (
    ReadingOptions,
    SceneRequest,
    base_name,
    film_options,
    load_job,
    own_name,
    suggest_scene,
    volume_options,
    volume_spec,
)
from hsplat_cli.terminal import OutputPath, Reporter, VolumePath
from renderer.errors import HsplatError, InputError
from renderer.film import locked_files, require_writable_dry_run, write_staged
from renderer.suggest import FilmOptions
from renderer.system import interrupted_status

_CTRL_C_STATUS = 128 + signal.SIGINT
# Names of the options that are for volumes; with a scene they are refused.
_FOR_VOLUMES = [field.name for cls in (FilmOptions, ReadingOptions) for field in fields(cls)]
_PAGE = "Write to this page.  [default: NAME.html in the current folder]"


@click.command()
@click.argument("source", type=VolumePath(), metavar="SCENE|VOLUME")
@click.option("-o", "--output", "page", type=OutputPath(dir_okay=False), metavar="FILE", help=_PAGE)
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value of the scene.")
@click.option("--volume", type=VolumePath(), metavar="FILE", help="Take the volume of the scene from this file.")
@click.option("--watch", "watches", is_flag=True, help="Draw a scene again whenever its file is saved.")
@click.option("--serve", is_flag=True, help="As --watch, on a page that this machine alone can open.")
@film_options
@volume_options()
@cache_option
@quiet_option()
def preview(
    *,
    source: Path | str,
    page: Path | None,
    overrides: tuple[str, ...],
    volume: Path | str | None,
    watches: bool,
    serve: bool,
    film: FilmOptions,
    reading: ReadingOptions,
    reporter: Reporter,
) -> None:
    """Show a scene or a volume on one page, before its film is made.

    SCENE is a YAML file, or the JSON file beside a film; VOLUME a file, a folder of slices, or the URL of a store,
    whose scene is suggested. The page shows frames of the film, the object as it turns, histograms with the visible
    values marked, slices, and variants of the scene with the lines of YAML that give them; to be read, it needs no
    network. For a VOLUME, the other options are as for turntable. With --watch the page shows one picture of a SCENE,
    coarse at once and then finer, until Ctrl-C.
    """
    if isinstance(source, Path) and source.suffix.lower() in (".yaml", ".yml", ".json"):
        request = SceneRequest(source, overrides, volume)
        name = base_name(source.with_suffix(""))
        require_none_of(_FOR_VOLUMES, "--set changes a value of a scene")
        if watches or serve:
            _watch(request, page or Path(f"{name}.html"), serve=serve, reporter=reporter)
            return
    else:
        if watches or serve:
            raise InputError("this is for a scene", where="--watch", got=f"the volume {source}")
        name = base_name(source)
        spec, scene = volume_spec(source, reading), Path(f"{name}.yaml")
        text, _ = suggest_scene(spec, film, reporter, scene=scene, output=Path(f"{name}.mp4"))
        request = SceneRequest(scene, overrides, volume, content=text.encode())
    job, page = load_job(request, "nothing"), page or Path(f"{name}.html")
    # Imported here to keep --help fast.
    from hsplat_cli.preview import NUM_PARTS, preview_page
    from hsplat_cli.reports import require_report_name

    require_report_name("--output", page, [*([source] if isinstance(source, Path) else []), *job.input_files()])
    require_writable_dry_run(page)
    with locked_files([page]):
        with reporter.progress([1.0] * NUM_PARTS, label="preview", unit="parts") as bar:
            content, glances = preview_page(job, f"Preview of {own_name(source)}", bar.advance)
        write_staged(page, content.encode())
    for each in glances:
        reporter.note(each.note)
    reporter.line(f"page: {page}")


def _watch(request: SceneRequest, page: Path, *, serve: bool, reporter: Reporter) -> None:
    """Show a scene on a page until Ctrl-C."""
    from hsplat_cli.preview import file_states, served_states, watch
    from hsplat_cli.reports import require_report_name

    title = request.path.absolute().name
    try:
        with contextlib.ExitStack() as stack:
            if serve:
                address, show = stack.enter_context(served_states(title))
            else:
                inputs = _known_inputs(request)
                require_report_name("--output", page, inputs)
                address, show = str(page), stack.enter_context(file_states(page, title, inputs))
            reporter.line(f"page: {address} (Ctrl-C ends it)")
            watch(request, show)
    except KeyboardInterrupt as error:
        if interrupted_status(error) != _CTRL_C_STATUS:  # other signals end the program with a status
            raise


def _known_inputs(request: SceneRequest) -> list[Path]:
    """Return the files that a scene names; only its own file if it has mistakes, which the page will show."""
    with contextlib.suppress(HsplatError):
        return [*load_job(request, "nothing", reads="nothing").input_files()]
    return [request.path]
