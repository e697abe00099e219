"""`hsplat compare GOLDEN ACTUAL`: whether frames are as they should be, for people and for CI.

Exit codes: 0 all pass, 1 something differs, 2 it could not be compared, as `main.run` sees to. The command is
in this package, and not with what compares, because it also draws goldens anew.
"""

from __future__ import annotations

from pathlib import Path

import click

from hsplat_cli.executors import workers_option
from hsplat_cli.terminal import OutputPath, sigterm_as_interrupt
from renderer.errors import InputError

_file = click.Path(path_type=Path)
_written = OutputPath()


def _named(_: click.Context, parameter: click.Parameter, name: str) -> Path:
    """What is compared; an empty name, as of a variable that is not set, would be the current folder."""
    if not name:
        raise InputError("an empty name", where=str(parameter.name).upper(), expected="a file or folder")
    return Path(name)


@click.command()
@click.argument("golden", callback=_named)
@click.argument("actual", callback=_named)
@click.option("--level", metavar="LEVEL", help="exact, same-machine (the default) or cross-driver.")
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="FIGURE=VALUE",
    help="Another limit, such as largest=4 or flip=none; of largest, p99, flip, ssim, densest and bias.",
)
@click.option("--json", "json_file", type=_written, metavar="FILE", help="Write what came of every frame as JSON.")
@click.option(
    "--junit", "junit_file", type=_written, metavar="FILE", help="Write a JUnit report, as CI systems read it."
)
@click.option("--html", "html_file", type=_written, metavar="FILE", help="Write a page that shows the worst frames.")
@click.option("--frames", metavar="A:B:STEP", help="Of a scene: compare only those of its goldens in this range.")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Of a scene: change a value.")
@click.option("--volume", type=_file, metavar="FILE", help="Of a scene: take the volume from this file.")
@workers_option
@click.option("--quiet", is_flag=True, help="Say nothing unless a frame fails.")
@click.pass_context
def compare(
    context: click.Context,
    golden: Path,
    actual: Path,
    level: str | None,
    limits: tuple[str, ...],
    json_file: Path | None,
    junit_file: Path | None,
    html_file: Path | None,
    frames: str | None,
    overrides: tuple[str, ...],
    volume: Path | None,
    workers: int | None,
    quiet: bool,
) -> None:
    """Compare frames with golden ones; exit with 1 where they differ.

    GOLDEN and ACTUAL are two PNG pictures, two folders of them or templates such as frames/{frame:04}.png, or two
    films. A file compare.yaml beside the goldens may have limits of its own.

    Or they are a scene and a folder of goldens that `hsplat golden` made: the frames are drawn again and compared.
    """
    with sigterm_as_interrupt():
        # Imported here: numpy takes longer to load than --help may take to answer.
        from hsplat_cli.compare import ReportFiles, SceneOptions, compare_frames, comparison_table

        reports = ReportFiles(json_file, junit_file, html_file)
        drawing = SceneOptions(frames, overrides, volume, workers)
        comparison = compare_frames(golden, actual, reports, drawing, level=level, limits=limits, quiet=quiet)
    if not (quiet and comparison.passes):
        click.echo(comparison_table(comparison))
    if not comparison.passes:
        context.exit(1)
