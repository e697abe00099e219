"""The figures as one page that loads nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hsplat_cli.reports import figure_to_svg, format_facts, png_data_uri, render_page
from hsplat_cli.studies.paper.paper_figure import Figure, Row

# Small pictures are shown larger, by whole pixels, and large ones as they are.
_MIN_SHOWN_PX = 190


def paper_page(figures: Sequence[Figure], *, facts: Mapping[str, Any]) -> str:
    """The whole page; facts: what it depends on, for its head. Inside `report.html.plot_style`."""
    claims = [claim for figure in figures for claim in figure.claims]
    return render_page(
        "paper.html",
        title="Hierarchical splatting, 1991, drawn anew",
        facts=format_facts(facts),
        figures=[_content(figure) for figure in figures],
        num_claims=len(claims),
        num_seen=sum(claim.seen for claim in claims),
    )


def _content(figure: Figure) -> dict[str, Any]:
    charts = [
        {"svg": figure_to_svg(chart.plot, name=f"figure-{figure.number}-{k}", alt=chart.alt), "caption": chart.caption}
        for k, chart in enumerate(figure.charts)
    ]
    return {
        "number": figure.number,
        "title": figure.title,
        "shows": figure.shows,
        "claims": figure.claims,
        "notes": figure.notes,
        "rows": [{"title": row.title, "pictures": _pictures(row)} for row in figure.rows],
        "charts": charts,
        "tables": figure.tables,
    }


def _pictures(row: Row) -> list[dict[str, Any]]:
    pictures = []
    for picture in row.pictures:
        height, width = picture.pixels.shape[:2]
        times = max(1, _MIN_SHOWN_PX // width)
        pictures.append(
            {
                "uri": png_data_uri(picture.pixels),
                "caption": picture.caption,
                "width": times * width,
                "height": times * height,
            }
        )
    return pictures
