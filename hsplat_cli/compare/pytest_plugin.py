"""Compares and accepts golden frames in pytest, as `hsplat compare` and `hsplat golden --accept` do.

pytest loads this file wherever hsplat is installed, so it imports the rest of hsplat only when it is used: other test
suites should not wait for numpy.
"""

from __future__ import annotations

import hashlib
import os
import urllib.parse
from collections.abc import Callable
from pathlib import Path

import pytest

# The most characters of a part of a report's path, but for a digest.
_MOST_CHARACTERS = 100
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


def pytest_sessionstart(session: pytest.Session) -> None:
    """Accept the pictures of a report, if an option asks for it, once for all processes that run tests."""
    config = session.config
    report, only = config.getoption("golden_accept"), config.getoption("golden_only")
    if only and report is None:
        raise pytest.UsageError("--golden-only is of no use without --golden-accept")
    if report is None or hasattr(config, "workerinput"):
        return
    from hsplat_cli.compare import accept_goldens
    from renderer.errors import HsplatError

    try:
        config.stash[_ACCEPTED] = accept_goldens(report, _places(config), only)
    except HsplatError as error:
        raise pytest.UsageError(str(error)) from None


def pytest_report_header(config: pytest.Config) -> list[str]:
    """Return the lines on accepted pictures."""
    return [f"goldens: {line}" for line in config.stash.get(_ACCEPTED, [])]


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Make a test that uses `golden_scene` a test of each scene of the project."""
    if "golden_scene" not in metafunc.fixturenames:
        return
    from hsplat_cli.compare import tested_scenes
    from renderer.errors import HsplatError

    try:
        scenes = tested_scenes(_places(metafunc.config))
    except HsplatError as error:
        raise pytest.Collector.CollectError(str(error)) from None
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
    from hsplat_cli.compare import require_match

    reports = pytestconfig.getoption("golden_report")

    def assert_match(
        *places: str | Path,
        limit: str | float | None = None,
        goldens: str | Path | None = None,
        report: str | Path | None = None,
    ) -> None:
        __tracebackhide__ = True  # pytest shows the line of the test
        if report is None and reports is not None:
            report = _report_folder(reports)
        require_match(*places, limit=limit, goldens=goldens, report=report)

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
