"""Run `hsplat golden SCENE...`: draw and keep reference frames of scenes, or accept those of a report."""

from __future__ import annotations

import contextlib
import glob
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

import click

from hsplat_cli.commands.shared_options import FILE, FRAMES_WORDS, quiet_option
from hsplat_cli.terminal import OutputPath, Reporter
from renderer.errors import InputError


@click.command()
@click.argument("scenes", nargs=-1, metavar="[SCENE|FOLDER|PATTERN]...")
@click.option(
    "--goldens", type=OutputPath(), metavar="FOLDER", help="The folder of all goldens. [default: goldens, beside them]"
)
@click.option("--frames", metavar="A:B:STEP", help=f"Only these frames: {FRAMES_WORDS}")
@click.option("--limit", metavar="LIMIT", help="same bytes, stated accuracy, or decibels: tells when it is too loose.")
@click.option("--digests", is_flag=True, help="Keep digests in golden.json alone, and no pictures.")
@click.option("--update", is_flag=True, help="Show the changes, and replace goldens.")
@click.option("--also", is_flag=True, help="Keep the pictures of this machine beside others, where they differ.")
@click.option("--prune", is_flag=True, help="With --update: remove goldens that no drawn frame, or no scene, has.")
@click.option(
    "--accept", "report", type=FILE, metavar="REPORT", help="Draw nothing: take the new pictures of a report."
)
@click.option("--only", multiple=True, metavar="SCENE:FRAMES", help="With --accept: these alone, engine:12-18,40.")
@click.option("--yes", is_flag=True, help="Do not ask.")
@quiet_option(help="Print only errors, and the changes before a question.")
def golden(
    *,
    scenes: tuple[str, ...],
    goldens: Path | None,
    frames: str | None,
    limit: str | None,
    digests: bool,
    update: bool,
    also: bool,
    prune: bool,
    report: Path | None,
    only: tuple[str, ...],
    yes: bool,
    reporter: Reporter,
) -> None:
    """Keep frames of scenes to compare later ones with.

    The goldens of scenes/engine.yaml are in scenes/goldens/engine: frame-0000.png and so on, and golden.json, which
    records what they were drawn from. A file golden.yaml may list scenes, frames and limits. `hsplat compare` draws the
    frames again and compares them.

    With --accept, nothing is drawn: goldens become the new pictures in the report of a comparison, such as the artifact
    of a CI job.
    """
    given: dict[str, object] = {"--update": update, "--also": also, "--prune": prune, "--frames": frames}
    given |= {"--accept": report, "--only": only, "--limit": limit}
    _require_together({option for option, value in given.items() if value not in (None, False, ())})
    # Imported here to keep --help fast.
    from hsplat_cli.compare import (
        GoldenOptions,
        find_project,
        open_reports,
        parse_decisions,
        parse_rules,
        plan_acceptance,
        plan_removals,
        plan_update,
        scenes_to_draw,
        update_goldens,
    )

    if only:
        _require_places(scenes)
    rules = parse_rules(frames, limit, "digests" if digests else None)
    project = find_project(scenes, goldens, rules)
    with contextlib.ExitStack() as sources:
        if report is not None:
            reports = sources.enter_context(open_reports(report))
            updates = plan_acceptance(reports, project, parse_decisions(only), reporter, also=also)
        else:
            wanted = GoldenOptions(frames, replaces=update, also=also, prunes=prune)
            drawn = scenes_to_draw(project, wanted, reporter)
            planned = [plan_update(each, wanted, reporter, sources) for each in drawn]
            updates = [each for each in planned if each is not None]
            updates += plan_removals(project.unused, wanted, reporter)
        if not updates:
            reporter.line("nothing changes")
        elif not update_goldens(updates, reporter, lambda: _confirm(reporter), yes=yes):
            reporter.result("nothing was written")
            raise click.exceptions.Exit(1)


def _require_together(given: set[str]) -> None:
    """Raise InputError if options are given that have no use together."""
    for option, needed in (("--prune", "--update"), ("--only", "--accept")):
        if option in given and needed not in given:
            raise InputError(f"of no use without {needed}", where=option)
    if {"--update", "--also"} <= given:
        raise InputError("one replaces goldens, the other keeps them", where="--update and --also")
    for option in ("--update", "--frames", "--limit"):
        if {option, "--accept"} <= given:
            raise InputError("of no use with --accept, which draws nothing", where=option)


def _require_places(scenes: Sequence[str]) -> None:
    """Raise InputError for a word after `--only` that is no scene: it may be a second film."""
    for place in scenes:
        if not os.path.exists(place) and not glob.has_magic(place):
            hint = f"if it is a film of the report, repeat --only: `--only {shlex.quote(place)}`"
            raise InputError("no such scene or folder", where=place, hint=hint)


def _confirm(reporter: Reporter) -> bool:
    """Ask the user whether to replace goldens. Raises InputError where nobody can answer."""
    if os.environ.get("CI", "").lower() not in ("", "0", "false"):
        reason = "CI is set in the environment"
    elif not sys.stdin.isatty():
        reason = "the standard input is not a terminal"
    else:
        return reporter.confirm("Replace these goldens?")
    raise InputError(
        "goldens are not replaced without a question, and nobody can answer",
        where="--update",
        got=reason,
        hint="--yes replaces them without one",
    )
