"""Make the page of a report: all films by verdict, and the pictures of those that fail."""

from __future__ import annotations

from hsplat_cli.compare.outcome import Comparison
from hsplat_cli.reports import render_page


def report_page(comparison: Comparison) -> str:
    """Return the HTML page of a report; equal outcomes give equal pages."""
    return render_page("comparison.html", title=comparison.summary, comparison=comparison)
