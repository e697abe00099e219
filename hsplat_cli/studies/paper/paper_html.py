"""Render the paper's figures as one HTML page without external resources."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hsplat_cli.reports import format_facts, render_page
from hsplat_cli.studies.paper.paper_figure import PaperFigure


def paper_page(figures: Sequence[PaperFigure], *, facts: Mapping[str, Any]) -> str:
    """Return the page as text. Call it inside `plot_style`.

    facts: what the page depends on, such as the machine; shown at its head.
    """
    claims = [claim for figure in figures for claim in figure.claims]
    return render_page(
        "paper.html",
        title="Hierarchical splatting, 1991, reproduced",
        facts=format_facts(facts),
        figures=figures,
        num_claims=len(claims),
        num_confirmed=sum(claim.is_confirmed for claim in claims),
    )
