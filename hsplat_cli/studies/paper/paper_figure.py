"""What a figure of the page is made of."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Plot

Pixels = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Claim:
    """Something that the paper says, and whether it was seen.

    says: the claim, in our words. criterion: what must be measured for it to count as seen. measured: what was.
    """

    says: str
    criterion: str
    measured: str
    seen: bool


@dataclass(frozen=True)
class Picture:
    """uint8 [h, w, 3] or, with straight alpha, [h, w, 4]."""

    pixels: Pixels
    caption: str


@dataclass(frozen=True)
class Row:
    """Pictures that are seen beside each other."""

    title: str
    pictures: tuple[Picture, ...]


@dataclass(frozen=True)
class Chart:
    """A plot; alt: what it shows, for who cannot see it."""

    plot: Plot
    alt: str
    caption: str


@dataclass(frozen=True)
class Table:
    """Cells as text, the first of each line being its heading."""

    caption: str
    header: tuple[str, ...]
    lines: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Figure:
    """One figure of the paper. notes: what a reader must know: what stood in for what, what was left out."""

    number: int
    title: str
    shows: str
    claims: tuple[Claim, ...]
    rows: tuple[Row, ...] = ()
    charts: tuple[Chart, ...] = ()
    tables: tuple[Table, ...] = ()
    notes: tuple[str, ...] = ()
