"""Looks of tables: colours at intensities of a range, and colours of labels."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from renderer.looks.curves import label_curve
from renderer.looks.look import Look
from renderer.looks.look_file import LookFile

# Label, colour, white, alpha, opaque alpha, place.
LabelRow = tuple[object, Sequence[object], float, object, float, object]

_LARGEST_LABEL = 2.0**53


def table_look(file: LookFile, rows: Sequence[Sequence[Any]], lowest: object, highest: object) -> Look:
    """Return the look of rows of intensity, red, green, blue and alpha, from 0 to 255.

    lowest, highest: the values of intensities 0 and 255; both are 0 where the table has no range.
    """
    low, high = file.number(lowest, "min"), file.number(highest, "max")
    has_range = high > low
    curve = []
    for k, (intensity, *parts) in enumerate(rows):
        share = file.number(intensity, f"intensity {k}", 0, 255) / 255
        value = low + share * (high - low) if has_range else share
        curve.append((value, tuple(file.number(part, f"colour {k}", 0, 255) / 255 for part in parts)))
    curve.sort(key=lambda point: point[0])
    return Look(curve, is_share=not has_range, span=(low, high))


def labels_look(file: LookFile, rows: Iterable[LabelRow]) -> Look:
    """Return the look of labels: steps half-way between them."""
    labels: dict[float, tuple[float, ...]] = {}
    for label, rgb, white, alpha, opaque, at in rows:
        opacity = file.number(alpha, at, 0.0, opaque) / opaque
        labels[file.number(label, at, 0.0, _LARGEST_LABEL)] = (*file.color(rgb, at, white), opacity)
    if not labels:
        raise file.error("no labels")
    return Look(label_curve({**labels, 0.0: (0.0, 0.0, 0.0, 0.0)}))
