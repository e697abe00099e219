"""Offers a pytest fixture that compares frames as `hsplat compare` does.

pytest loads this file wherever hsplat is installed, so the fixture imports the rest of hsplat only when it is used.
"""

from __future__ import annotations

from collections.abc import Callable

import pytest


@pytest.fixture(scope="session")
def assert_frames_match() -> Callable[..., None]:
    """Return a function that fails the test, with a table, if frames exceed their limits.

    golden, actual: as on the command line: images, folders, templates or films, or a scene and its folder of goldens.
    level: the name of a strictness, which replaces the file of limits beside the goldens. limits: the limit of each
    metric by its name; None removes a limit. html: an .html file for a page of the worst frames, which is written also
    if all frames match.

    The function raises AssertionError if frames differ, and InputError if they cannot be compared.
    """
    # Imported here: other test suites should not wait for numpy.
    from hsplat_cli.compare.comparison import require_match

    return require_match
