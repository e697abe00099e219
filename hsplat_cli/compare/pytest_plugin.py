"""A fixture for pytest that compares frames as `hsplat compare` does.

It is there in every run of pytest where hsplat is installed, and so imports nothing before it is used.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import pytest


class AssertFramesMatch(Protocol):
    """What the fixture is."""

    def __call__(
        self,
        golden: str | Path,
        actual: str | Path,
        *,
        level: str | None = None,
        limits: Mapping[str, float | None] | None = None,
        html: str | Path | None = None,
    ) -> None: ...


@pytest.fixture(scope="session")
def assert_frames_match() -> AssertFramesMatch:
    """A function that fails the test, with a table, where frames differ by more than they may.

    golden, actual: as on the command line: images, folders, templates or films, or a scene and the folder of its
    goldens.
    level: of the strictness, in the place of a file of limits beside the goldens. limits: other ones, by figure; None
    takes one away.
    html: a page of the frames that differ most is written to this .html file, whether they match or not.

    Raises AssertionError where frames differ, and InputError where they cannot be compared.
    """
    # Imported here: who has installed hsplat and tests something else does not wait for numpy.
    from hsplat_cli.compare.api import require_match

    return require_match
