"""Run `hsplat measure SCENE`: measure cost and accuracy of each setting on the user's scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import click

from hsplat_cli.commands.shared_options import quiet_option, takes_scene
from hsplat_cli.measure import parse_sweep, parse_want
from hsplat_cli.scenes import SceneRequest, load_job
from hsplat_cli.terminal import OutputPath, Reporter
from renderer.errors import InputError
from renderer.film import WrittenFiles
from renderer.scene import AnnotationSpec, Scene

# Names of the options on a sweep and its report; a search for one tolerance (--want) refuses them.
_SWEEP_OPTIONS = ("output", "tolerances", "footprints", "measures", "corrections", "repeats")
_WANT_HINT = "--want searches with the scene's own footprint and error measure; change them with --set"
# Names of the options that need whole exact pictures and several passes (--thorough).
_THOROUGH_OPTIONS = ("footprints", "measures", "corrections", "repeats")
_THOROUGH_HINT = (
    "add --thorough; without it the scene's own footprint and error measure are drawn once, and judged by rays"
)


@click.command()
@takes_scene("Measure on these frames; by default on three of the path.", set_help="Change a value of the scene.")
@click.option("--output", type=OutputPath(), metavar="FOLDER", help="Write the report there, not to SCENE.measured.")
@click.option("--tolerances", metavar="LIST", help="Such as 1,0.1,0; by default some that suit the volume.")
@click.option(
    "--footprints",
    metavar="LIST",
    help="Of gaussian, gouraud, gouraud:AxR and integrated; by default integrated,gaussian where both can show it.",
)
@click.option("--measures", metavar="LIST", help="Of optical, rms and rms:scalar; by default optical,rms if it can be.")
@click.option("--corrections", default="on,off", show_default=True, metavar="LIST", help="Of opacity: on, off.")
@click.option("--repeats", type=click.IntRange(1, 100), default=3, show_default=True, help="Timed passes, at most.")
@click.option(
    "--truth-tolerance",
    type=click.FloatRange(0, 1, min_open=True, max_open=True),
    default=1e-5,
    show_default=True,
    help="Integrate the truth until no channel of a pixel changes by more.",
)
@click.option("--thorough", is_flag=True, help="Compare with whole exact pictures, and not with a few exact rays.")
@click.option("--want", metavar="METRIC=VALUE", help="Only find the tolerance for psnr=38 (or rmse, ssim, flip).")
@quiet_option(help="Print only the result.")
def measure(
    request: SceneRequest,
    *,
    output: Path | None,
    tolerances: str | None,
    footprints: str | None,
    measures: str | None,
    corrections: str,
    repeats: int,
    truth_tolerance: float,
    thorough: bool,
    want: str | None,
    reporter: Reporter,
) -> None:
    """Measure the cost and the accuracy of a scene.

    SCENE is a YAML file. A page with plots, a CSV and a JSON file are written into the folder SCENE.measured.
    """
    given = load_job(request, "nothing")
    job, numbers = given.scene.changed(_without_annotation), given.frames  # annotation would count as errors
    sweep = parse_sweep(
        job.at(0), tolerances=tolerances, footprints=footprints, measures=measures, corrections=corrections
    )
    if want is not None:
        # Imported here to keep --help fast.
        from hsplat_cli.measure import print_tolerance

        _reject_options("has no use beside --want", _SWEEP_OPTIONS, _WANT_HINT)
        print_tolerance(job, parse_want(want), numbers, truth_tolerance if thorough else None, reporter)
        return
    if not thorough:
        _reject_options("needs --thorough", _THOROUGH_OPTIONS, _THOROUGH_HINT)
        # With no repeats, the first pass over the frames is timed.
        sweep, repeats = replace(sweep, errors=(job.error,), splats=(job.at(0).splat,)), 0
    from hsplat_cli.measure import PAGE_FILE, REPORT_FILES, StudyRequest, run_study
    from hsplat_cli.reports import require_own_page

    name = request.path.stem
    folder = output or Path(f"{name}.measured")
    WrittenFiles([folder / name for name in REPORT_FILES]).require_harmless(given.input_files())
    require_own_page(folder / PAGE_FILE)
    picked = list(numbers) if request.frames else None
    request_ = StudyRequest(name, job, sweep, picked, repeats, truth_tolerance, folder, not thorough)
    run_study(request_, reporter)


def _without_annotation(scene: Scene) -> Scene:
    return replace(scene, annotation=AnnotationSpec())


def _reject_options(why: str, names: Sequence[str], hint: str) -> None:
    """Raise InputError where one of these options, which would have no effect, is given."""
    source = click.get_current_context().get_parameter_source
    given = [name for name in names if source(name) == click.core.ParameterSource.COMMANDLINE]
    if given:
        raise InputError(f"{why}: --{given[0]}", where="hsplat measure", hint=hint)
