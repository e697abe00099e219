"""Empty plots in the page's colours; matplotlib is imported when one is made, inside `report.html.plot_style`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hsplat_cli.reports import LIGHT_PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# The colours of the page's series, which follow the reader's choice of light or dark.
SERIES = tuple(color for name, color in LIGHT_PALETTE.items() if name.startswith("series-"))

_SIDE_IN = 3.6


def new_plot(x_label: str, y_label: str) -> tuple[Figure, Axes]:
    """One plot with its axes."""
    plot, (axes,) = new_plots(1, side=_SIDE_IN, aspect=2.0)
    axes.set_xlabel(x_label)
    axes.set_ylabel(y_label)
    return plot, axes


def new_plots(num: int, *, side: float, aspect: float = 1.0) -> tuple[Figure, list[Axes]]:
    """Several beside each other, `side` inches high and `aspect` times as wide."""
    from matplotlib.figure import Figure

    plot = Figure(figsize=(num * side * aspect, side), layout="constrained")
    return plot, list(plot.subplots(1, num, squeeze=False)[0])
