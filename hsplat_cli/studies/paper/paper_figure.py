"""Describe a figure on the page of `hsplat paper`, and make empty plots for its charts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hsplat_cli.reports import Chart
from renderer.film import Pixels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_PLOT_HEIGHT_IN = 3.6


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, in our words, and whether measurements confirm it.

    criterion: what must be measured to confirm it. measured: what was measured.
    """

    statement: str
    criterion: str
    measured: str
    is_confirmed: bool


# Pictures side by side, by the title of the row: uint8 [h, w, 3] or, with straight alpha, [h, w, 4], and a caption.
PictureRows = Mapping[str, Sequence[tuple[Pixels, str]]]


@dataclass(frozen=True)
class PaperFigure:
    """One figure of the paper.

    tables: by caption; each line maps headings to cells, and its first cell is its heading. notes: what differs from
    the paper, such as a substitute volume.
    """

    number: int
    title: str
    description: str
    claims: tuple[Claim, ...]
    rows: PictureRows
    charts: tuple[Chart, ...] = ()
    tables: Mapping[str, Sequence[Mapping[str, str]]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


def new_plot(x_label: str, y_label: str) -> tuple[Figure, Axes]:
    """Return an empty plot and its axes. Call it inside `plot_style`."""
    plot, (axes,) = new_plots(1, height_in=_PLOT_HEIGHT_IN, aspect=2.0)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    return plot, axes


def new_plots(num: int, *, height_in: float, aspect: float = 1.0) -> tuple[Figure, list[Axes]]:
    """Return empty plots side by side, each `aspect` times as wide as high. Call it inside `plot_style`."""
    from matplotlib.figure import Figure

    plot = Figure(figsize=(num * height_in * aspect, height_in), layout="constrained")
    return plot, list(plot.subplots(1, num, squeeze=False)[0])
