"""The figures as one page that loads nothing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hsplat_cli.reports import facts_of, page_of, png_data_uri, svg_of
from hsplat_cli.studies.paper.figure import Figure, Row

# Small pictures are shown larger, by whole pixels, and large ones as they are.
_LEAST_SHOWN_PX = 190


def paper_page(figures: Sequence[Figure], *, facts: Mapping[str, Any]) -> str:
    """The whole page; facts: what it depends on, for its head. Inside `report.html.plot_style`."""
    claims = [claim for figure in figures for claim in figure.claims]
    return page_of(
        "paper.html",
        title="Hierarchical splatting, 1991, drawn anew",
        facts=facts_of(facts),
        figures=[_content(figure) for figure in figures],
        num_claims=len(claims),
        num_seen=sum(claim.seen for claim in claims),
    )


def _content(figure: Figure) -> dict[str, Any]:
    charts = [
        {"svg": svg_of(chart.plot, name=f"figure-{figure.number}-{k}", alt=chart.alt), "caption": chart.caption}
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
        times = max(1, _LEAST_SHOWN_PX // width)
        pictures.append(
            {
                "uri": png_data_uri(picture.pixels),
                "caption": picture.caption,
                "width": times * width,
                "height": times * height,
            }
        )
    return pictures
