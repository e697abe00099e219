"""Run `hsplat compare`: compare scenes with their goldens, or pictures with others, for people and for CI.

Exit codes: 0 if all frames pass, 1 if one fails, 2 if a film could not be compared (see `main.run`).
"""

from __future__ import annotations

import os
import secrets
from pathlib import Path

import click

from hsplat_cli.commands.shared_options import FILE, FRAMES_WORDS, quiet_option
from hsplat_cli.terminal import OutputPath, Reporter, VolumePath
from renderer.errors import HsplatError


@click.command()
@click.argument("places", nargs=-1, metavar="[SCENE|FOLDER|PATTERN]...")
@click.option(
    "--goldens", type=FILE, metavar="FOLDER", help="The folder of all goldens. [default: goldens, beside them]"
)
@click.option("--limit", metavar="LIMIT", help="same bytes, stated accuracy, or decibels, such as 45.")
@click.option(
    "--report", type=OutputPath(), metavar="FOLDER", help="Write a page, the pictures that fail, and files for CI."
)
@click.option("--frames", metavar="A:B:STEP", help=f"Compare only these frames: {FRAMES_WORDS}")
@click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value of all scenes.")
@click.option("--volume", type=VolumePath(), metavar="FILE", help="Take the volume of all scenes from this file.")
@quiet_option(help="Print nothing unless a frame fails.")
def compare(
    *,
    places: tuple[str, ...],
    goldens: Path | None,
    limit: str | None,
    report: Path | None,
    frames: str | None,
    overrides: tuple[str, ...],
    volume: Path | str | None,
    reporter: Reporter,
) -> None:
    """Compare frames with golden ones; exit with 1 where they differ.

    The goldens of scenes are drawn again. Without arguments, the scenes are those of golden.yaml in this folder. The
    exit code is 2 if a scene cannot be compared or has no goldens, or if goldens have no scene.

    Two sets of existing pictures can be compared, too: hsplat compare GOLDEN ACTUAL. Each is a PNG picture, a folder of
    them, a template such as frames/{frame:04}.png, or a film.
    """
    # Imported here to keep --help fast.
    from hsplat_cli.compare import (
        ComparisonRequest,
        compare as compare_all,
        comparison_text,
        error_line,
        github_error,
        github_lines,
        parse_rules,
        summary_markdown,
    )
    from renderer.system import join_lines

    is_on_github = os.environ.get("GITHUB_ACTIONS") == "true"
    try:
        rules = parse_rules(frames, limit)
        request = ComparisonRequest(places, rules, goldens, report, overrides, volume)
        comparison = compare_all(request, reporter)
    except HsplatError as error:
        if is_on_github:
            reporter.result(github_error(error_line(error)))
        raise
    passes = comparison.verdict == "passes"
    text = comparison_text(comparison)
    if is_on_github:  # names of files may look like commands of GitHub
        token = secrets.token_hex()
        text = join_lines([f"::stop-commands::{token}", *text.splitlines(), f"::{token}::"])
    (reporter.line if passes else reporter.result)(text)
    if report is not None:
        reporter.line(f"report: {report / 'index.html'}")
    if is_on_github:
        for line in github_lines(comparison):
            reporter.result(line)
        _add_summary(summary_markdown(comparison))
    if not passes:
        raise click.exceptions.Exit(2 if comparison.verdict == "not compared" else 1)


def _add_summary(text: str) -> None:
    """Add a text to the summary of a job of GitHub."""
    from renderer.film import translate_os_errors

    file = os.environ.get("GITHUB_STEP_SUMMARY")
    if file:
        with translate_os_errors(Path(file)), Path(file).open("a", encoding="utf-8") as summary:
            summary.write(text)
