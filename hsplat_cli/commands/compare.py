"""Run `hsplat compare GOLDEN ACTUAL`: compare frames with golden ones, for people and for CI.

Exit codes: 0 all pass, 1 something differs, 2 they could not be compared (see `main.run`).
"""

from __future__ import annotations

from pathlib import Path

import click

from hsplat_cli.commands.options import frames_option, no_paths_option, quiet_option, set_option, volume_option
from hsplat_cli.executors import workers_option
from hsplat_cli.terminal import OutputPath, Reporter, sigterm_as_interrupt
from renderer.errors import InputError

_REPORT = OutputPath(dir_okay=False)


def _parse_name(_: click.Context, parameter: click.Parameter, name: str) -> Path:
    """Return a path; refuse an empty name, as of an unset variable, which would be the current folder."""
    if not name:
        raise InputError("an empty name", where=str(parameter.name).upper(), expected="a file or folder")
    return Path(name)


@click.command()
@click.argument("golden", callback=_parse_name)
@click.argument("actual", callback=_parse_name)
@click.option("--level", metavar="LEVEL", help="exact, same-machine (the default) or cross-driver.")
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="FIGURE=VALUE",
    help="Another limit, such as largest=4 or flip=none; of largest, p99, flip, ssim, densest and bias.",
)
@click.option("--json", "json_file", type=_REPORT, metavar="FILE", help="Write the result of every frame as JSON.")
@click.option("--junit", "junit_file", type=_REPORT, metavar="FILE", help="Write a JUnit report for CI systems.")
@click.option("--html", "html_file", type=_REPORT, metavar="FILE", help="Write a page that shows the worst frames.")
@no_paths_option(callback=None, help="Leave folders out of the reports.")
@frames_option(help="Of a scene: compare only its goldens in this range.")
@set_option(help="Of a scene: change a value.")
@volume_option(help="Of a scene: take the volume from this file.")
@workers_option
@quiet_option(help="Print nothing unless a frame fails.")
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
    no_paths: bool,
    frames: str | None,
    overrides: tuple[str, ...],
    volume: Path | None,
    workers: int | None,
    reporter: Reporter,
) -> None:
    """Compare frames with golden ones; exit with 1 where they differ.

    GOLDEN and ACTUAL are two PNG pictures, two folders of them or templates such as frames/{frame:04}.png, or two
    films. A file compare.yaml beside the goldens may set limits.

    Or they are a scene and a folder of goldens that `hsplat golden` made: then the frames are drawn again and compared.
    """
    with sigterm_as_interrupt():
        # Imported here to keep --help fast.
        from hsplat_cli.compare import ReportFiles, SceneOptions, compare_frames, comparison_table

        files = {"--json": json_file, "--junit": junit_file, "--html": html_file}
        private = [golden, actual] if no_paths else []
        reports = ReportFiles({option: path for option, path in files.items() if path}, private)
        drawing = SceneOptions(frames, overrides, volume, workers)
        comparison = compare_frames(golden, actual, reports, drawing, level=level, limits=limits, reporter=reporter)
    if comparison.passes:
        reporter.line(comparison_table(comparison))
    else:
        reporter.result(comparison_table(comparison))
        context.exit(1)
