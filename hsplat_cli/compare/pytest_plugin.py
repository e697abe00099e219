"""Compares and accepts golden frames in pytest, as `hsplat compare` and `hsplat golden --accept` do.

pytest loads this file wherever hsplat is installed, so it imports the rest of hsplat only when it is used: other test
suites should not wait for numpy.
"""

from __future__ import annotations

import hashlib
import os
import shlex
import urllib.parse
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

# The most characters of a part of a report's path, but for a digest.
_MOST_CHARACTERS = 100
# The options whose values are paths.
_OPTIONS_OF_PATHS = ("--golden-report", "--golden-accept")
_ACCEPTED = pytest.StashKey[list[str]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options of golden frames."""
    group = parser.getgroup("hsplat", "golden frames of hsplat")
    group.addoption("--golden-report", type=Path, metavar="FOLDER", help="Write a report of each test below a folder.")
    group.addoption(
        "--golden-accept",
        type=Path,
        metavar="REPORT",
        help="Before the tests, make the new pictures of reports golden: a folder, or a ZIP archive.",
    )
    group.addoption(
        "--golden-only",
        action="append",
        default=[],
        metavar="SCENE:FRAMES",
        help="With --golden-accept: these alone, engine:12-18,40. May be given several times.",
    )
    parser.addini("golden_scenes", "scenes with goldens, folders, or a golden.yaml (the default)", type="paths")


def pytest_load_initial_conftests(early_config: pytest.Config, args: list[str]) -> None:
    """Refuse the path of a report as a word of its own, where it lies outside of the current folder.

    pytest does not know the option yet when it looks for pytest.ini, and takes the path for one of tests.
    """
    here = early_config.invocation_params.dir.resolve()
    for option, value in pairwise(args):
        if option in _OPTIONS_OF_PATHS and here not in (here / value).resolve().parents:
            raise pytest.UsageError(
                f"{option} {value}: pytest would look for pytest.ini there\n  hint: write {option}={shlex.quote(value)}"
            )


def pytest_sessionstart(session: pytest.Session) -> None:
    """Accept the pictures of a report, if an option asks for it, once for all processes that run tests."""
    config = session.config
    report, only = config.getoption("golden_accept"), config.getoption("golden_only")
    if only and report is None:
        raise pytest.UsageError("--golden-only is of no use without --golden-accept")
    if report is None or hasattr(config, "workerinput"):
        return
    from hsplat_cli.compare import find_project, open_reports, parse_decisions, plan_acceptance, update_goldens
    from hsplat_cli.terminal import Reporter
    from renderer.errors import HsplatError

    try:
        decisions = parse_decisions(only)
        with open_reports(report) as reports:
            reporter = Reporter(is_quiet=True)
            updates = plan_acceptance(reports, find_project(_places(config)), decisions, reporter)
            update_goldens(updates, reporter, lambda: True, yes=True)
    except HsplatError as error:
        raise pytest.UsageError(str(error)) from None
    config.stash[_ACCEPTED] = [line for update in updates for line in update.lines]


def pytest_report_header(config: pytest.Config) -> list[str]:
    """Return the lines on accepted pictures."""
    return [f"goldens: {line}" for line in config.stash.get(_ACCEPTED, [])]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make a test that uses `golden_scene` a test of each scene of the project."""
    if "golden_scene" not in metafunc.fixturenames:
        return
    from hsplat_cli.compare import find_project, unused_error
    from renderer.errors import HsplatError

    places = _places(metafunc.config)
    try:
        project = find_project(places)
    except HsplatError as error:
        raise pytest.Collector.CollectError(str(error)) from None
    scenes: dict[str, Path | str] = {scene.name: scene.file for scene in project.scenes}
    scenes |= {str(folder.path): str(unused_error(folder, places)) for folder in project.unused}
    metafunc.parametrize("golden_scene", [*scenes.values()], ids=[*scenes], indirect=True)


@pytest.fixture
def golden_scene(request: pytest.FixtureRequest) -> Path:
    """Return the file of a scene of the project. The test fails instead for goldens that no scene has."""
    if isinstance(request.param, str):
        pytest.fail(request.param, pytrace=False)
    scene: Path = request.param
    return scene


def _places(config: pytest.Config) -> list[str]:
    """Return the places of the scenes that have goldens."""
    given = config.getini("golden_scenes")
    return [str(place) for place in given] or [str(config.rootpath / "golden.yaml")]


@pytest.fixture(scope="session")
def assert_frames_match(pytestconfig: pytest.Config) -> Callable[..., None]:
    """Return a function that fails the test, with the reasons, if frames exceed their limit.

    places: as on the command line: scenes, folders, patterns or a golden.yaml; or two sets of pictures, of which the
    first is golden. limit: `same bytes`, `stated accuracy`, or decibels. goldens: the folder of all goldens. report: a
    folder for the report; without it, that of the test below `--golden-report`, if this is given.

    The function raises AssertionError if frames differ, or if they cannot be compared.
    """
    reports = pytestconfig.getoption("golden_report")

    def assert_match(
        *places: str | Path,
        limit: str | float | None = None,
        goldens: str | Path | None = None,
        report: str | Path | None = None,
    ) -> None:
        __tracebackhide__ = True  # pytest shows the line of the test
        from hsplat_cli.compare import ComparisonRequest, compare, comparison_text, parse_rules
        from hsplat_cli.terminal import Reporter
        from renderer.errors import HsplatError
        from renderer.system import join_lines

        if report is None and reports is not None:
            report = _report_folder(reports)
        folder_of_goldens, folder_of_report = (None if each is None else Path(each) for each in (goldens, report))
        try:
            rules = parse_rules(None, None if limit is None else str(limit))
            request = ComparisonRequest([*map(str, places)], rules, folder_of_goldens, folder_of_report)
            comparison = compare(request, Reporter(is_quiet=True))
        except HsplatError as error:
            raise AssertionError(str(error)) from None
        if comparison.verdict != "passes":
            page = [] if report is None else [f"report: {Path(report, 'index.html')}"]
            raise AssertionError(join_lines([*comparison_text(comparison).splitlines(), *page]))

    return assert_match


def _report_folder(reports: Path) -> Path:
    """Return the folder for the report of the test that runs, by its name; artifacts of CI forbid some characters."""
    test = os.environ["PYTEST_CURRENT_TEST"].rpartition(" ")[0]
    parts = map(_folder_name, test.replace("::", "/").split("/"))
    return reports.joinpath(*(part for part in parts if part.strip(".")))


def _folder_name(part: str) -> str:
    """Return a part of the name of a test as that of a folder; a long one has a digest in place of its end."""
    name = urllib.parse.quote(part, safe="[]")
    if len(name) <= _MOST_CHARACTERS:
        return name
    return f"{name[:_MOST_CHARACTERS]}-{hashlib.blake2b(name.encode(), digest_size=8).hexdigest()}"
