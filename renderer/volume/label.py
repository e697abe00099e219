"""Define a label of a volume of labels, as a file describes it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Label:
    """A description of the voxels with one value. Every field but the value may be unknown.

    name: the name in the file, which may be unprintable. color, opacity: in [0, 1].
    """

    value: int
    name: str = ""
    color: tuple[float, float, float] | None = None
    opacity: float | None = None
