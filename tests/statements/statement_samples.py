"""Pairs of files that differ in one field of a format, for each entry of the readers' tables of statements.

Each module `stated_*.py` has `SAMPLES`: by format, then by field.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

# Writes a file, or several, into an empty folder, and returns the path to read.
Writer = Callable[[Path], Path]


class Sample(NamedTuple):
    """A pair of files that differ in one field alone: `plain` lacks it or has its neutral value.

    choice: of the volume specification, as `component=1`.
    """

    plain: Writer
    stated: Writer
    choice: dict[str, object] = {}  # noqa: RUF012  never changed


Samples = dict[str, dict[str, Sample]]
