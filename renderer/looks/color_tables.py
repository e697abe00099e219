"""Make looks from tables of colours, which stand at even distances, at given intensities, or for labels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from renderer.looks.curves import CurvePoint, Numbers
from renderer.looks.look import Look
from renderer.looks.look_file import LookFile
from renderer.volume import Label

# A transparent colour: red, green, blue and opacity.
_CLEAR = (0.0, 0.0, 0.0, 0.0)


def even_look(file: LookFile, rows: Sequence[Sequence[Any]], white: float, last: float = 0.0) -> Look:
    """Return a look with colours at even distances over a range of values.

    rows: for each colour its place in the file (for messages), red, green and blue. white: the number that stands for
    full red, green or blue. last: the index of the row at the end of the range; 0 for the last row.
    """
    end = last or max(len(rows) - 1, 1)
    return Look(file.curve(((at, k / end, *rgb) for k, (at, *rgb) in enumerate(rows)), 3, white), is_share=True)


def table_look(file: LookFile, rows: Iterable[Sequence[Any]], lowest: object, highest: object) -> Look:
    """Return a look with colours at given intensities: positions in a range of values, from 0 to 255.

    rows: for each colour its place in the file (for messages), its intensity, red, green, blue and alpha, from 0 to
        255.
    lowest, highest: the values of intensities 0 and 255; both are 0 if the table has no range.
    """
    low, high = file.number(lowest, "min"), file.number(highest, "max")
    is_share = high <= low
    low, high = (0.0, 1.0) if is_share else (low, high)
    placed = ((at, low + file.number(step, at, 0, 255) / 255 * (high - low), *rgba) for at, step, *rgba in rows)
    return Look(file.curve(placed, 4, 255.0), is_share=is_share, span=(low, high))


def labels_look(labels: Iterable[Label]) -> Look:
    """Return the look of the labels that have a colour.

    A label's colour reaches half-way to the next labels. Label 0 and labels that the table lacks are transparent.
    """
    colors: dict[float, Numbers] = {
        each.value: (*each.color, 1.0 if each.opacity is None else each.opacity) for each in labels if each.color
    }
    colors[0] = _CLEAR
    curve, end = list[CurvePoint](), min(colors) - 0.5
    for label in sorted(colors):
        low, high = label - 0.5, label + 0.5
        if end < low:
            curve += [(end, _CLEAR), (low, _CLEAR)]
        curve += [(max(low, end), colors[label]), (high, colors[label])]
        end = high
    return Look([*curve, (end, _CLEAR)], span=(min(colors), max(colors)))
