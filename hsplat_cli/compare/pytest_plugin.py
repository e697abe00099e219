"""Offers a pytest fixture that compares frames as `hsplat compare` does.

pytest loads this file wherever hsplat is installed, so the fixture imports the rest of hsplat only when it is used.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest


@pytest.fixture(scope="session")
def assert_frames_match() -> Callable[..., None]:
    """Return a function that fails the test, with the reasons, if frames exceed their limit.

    places: as on the command line: scenes, folders, patterns or a golden.yaml; or two sets of pictures, of which the
    first is golden. limit: `same bytes`, `stated accuracy`, or decibels. goldens: the folder of all goldens. report: a
    folder for the report.

    The function raises AssertionError if frames differ, or if they cannot be compared.
    """
    # Imported here: other test suites should not wait for numpy.
    from hsplat_cli.compare import require_match

    return require_match
