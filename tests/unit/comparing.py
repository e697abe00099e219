"""Compares pictures that a test makes, as `hsplat compare` does."""

from __future__ import annotations

from pathlib import Path

from hsplat_cli.compare import ComparedFilm, ComparisonRequest, compare, parse_rules
from hsplat_cli.terminal import Reporter


def compare_files(golden: Path, actual: Path, limit: str | None = None) -> ComparedFilm:
    """Return the comparison of two files, folders or templates."""
    request = ComparisonRequest([str(golden), str(actual)], parse_rules(None, limit))
    (film,) = compare(request, Reporter(is_quiet=True)).films
    return film
