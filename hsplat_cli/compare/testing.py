"""Compare and accept goldens for tests: the pytest plugin calls these functions when it is used."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from hsplat_cli.compare.comparison import ComparisonRequest, compare
from hsplat_cli.compare.golden.acceptance import parse_decisions, plan_acceptance
from hsplat_cli.compare.golden.project import find_project, parse_rules, unused_error
from hsplat_cli.compare.golden.update import update_goldens
from hsplat_cli.compare.report_source import open_reports
from hsplat_cli.compare.terminal_text import comparison_text
from hsplat_cli.terminal import Reporter
from renderer.errors import HsplatError
from renderer.system import join_lines


def tested_scenes(places: Sequence[str]) -> dict[str, Path | str]:
    """Return the files of a project's scenes, by their names, and an error for each folder of goldens without a scene.

    Raises InputError if there is no scene.
    """
    project = find_project(places)
    scenes: dict[str, Path | str] = {scene.name: scene.file for scene in project.scenes}
    return scenes | {str(folder.path): str(unused_error(folder, places)) for folder in project.unused}


def accept_goldens(report: Path, places: Sequence[str], only: Sequence[str]) -> list[str]:
    """Make the new pictures of reports the goldens of a project, as `hsplat golden --accept` does.

    only: as on the command line. Return a line for each changed film.
    """
    decisions = parse_decisions(only)
    with open_reports(report) as reports:
        updates = plan_acceptance(reports, find_project(places), decisions)
        update_goldens(updates, Reporter(is_quiet=True), lambda: True, yes=True)
    return [line for update in updates for line in update.lines]


def require_match(
    *places: str | Path,
    limit: str | float | None = None,
    goldens: str | Path | None = None,
    report: str | Path | None = None,
) -> None:
    """Raise AssertionError, with the text of `hsplat compare`, unless all frames pass.

    The arguments have the same meaning as the arguments of the fixture `assert_frames_match`.
    """
    __tracebackhide__ = True  # pytest hides this function, and shows the line of the test
    try:
        request = ComparisonRequest(
            [*map(str, places)],
            parse_rules(None, None if limit is None else str(limit)),
            None if goldens is None else Path(goldens),
            None if report is None else Path(report),
        )
        comparison = compare(request, Reporter(is_quiet=True))
    except HsplatError as error:
        raise AssertionError(str(error)) from None
    if comparison.verdict != "passes":
        page = [] if report is None else [f"report: {Path(report, 'index.html')}"]
        raise AssertionError(join_lines([*comparison_text(comparison).splitlines(), *page]))
