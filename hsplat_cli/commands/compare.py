"""Run `hsplat compare GOLDEN ACTUAL`: compare frames with golden ones, for people and for CI.

Exit codes: 0 where all frames pass, 1 where one differs, 2 where they could not be compared (see `main.run`).
"""

from __future__ import annotations

from pathlib import Path

import click

from hsplat_cli.commands.shared_options import quiet_option, takes_scene
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import OutputPath, Reporter, option_group
from renderer.errors import InputError

_REPORT = OutputPath(dir_okay=False)


def _parse_name(_: click.Context, parameter: click.Parameter, name: str) -> Path:
    """Return the path that an argument names. Raises InputError for an empty name, which an unset shell variable gives.

    An empty name would mean the current folder.
    """
    if not name:
        raise InputError("an empty name", where=parameter.human_readable_name, expected="a file or folder")
    return Path(name)


_SIDES = option_group(
    click.argument("scene", metavar="GOLDEN", callback=_parse_name), click.argument("actual", callback=_parse_name)
)


@click.command()
@click.option("--level", metavar="LEVEL", help="exact, same-machine (the default) or cross-driver.")
@click.option(
    "--limit",
    "limits",
    multiple=True,
    metavar="FIGURE=VALUE",
    help="Change a limit: largest=4 or flip=none. The figures: largest, p99, flip, ssim, densest and bias.",
)
@click.option("--json", "json_file", type=_REPORT, metavar="FILE", help="Write the result of every frame as JSON.")
@click.option("--junit", "junit_file", type=_REPORT, metavar="FILE", help="Write a JUnit report for CI systems.")
@click.option("--html", "html_file", type=_REPORT, metavar="FILE", help="Write a page that shows the worst frames.")
@takes_scene(
    "For a scene: compare only its goldens in this range.",
    set_help="For a scene: change a value.",
    volume_help="For a scene: take the volume from this file.",
    arguments=_SIDES,
)
@quiet_option(help="Print nothing unless a frame fails.")
def compare(
    request: SceneRequest,
    *,
    actual: Path,
    level: str | None,
    limits: tuple[str, ...],
    json_file: Path | None,
    junit_file: Path | None,
    html_file: Path | None,
    reporter: Reporter,
) -> None:
    """Compare frames with golden ones; exit with 1 where they differ.

    GOLDEN and ACTUAL are two PNG pictures, two folders of them or templates such as frames/{frame:04}.png, or two
    films. A file compare.yaml beside the goldens may set limits.

    They may also be a scene and a folder of goldens that `hsplat golden` made: then the frames are drawn again and
    compared.
    """
    # Imported here to keep --help fast.
    from hsplat_cli.compare import ReportFiles, compare_frames, comparison_table

    files = {"--json": json_file, "--junit": junit_file, "--html": html_file}
    reports = ReportFiles({option: path for option, path in files.items() if path})
    comparison = compare_frames(request, actual, reports, level=level, limits=limits, reporter=reporter)
    if comparison.passes:
        reporter.line(comparison_table(comparison))
    else:
        reporter.result(comparison_table(comparison))
        raise click.exceptions.Exit(1)
