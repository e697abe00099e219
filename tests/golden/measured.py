"""Compute every figure of a comparison for every change of a frame, harmless ones and defects."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from defects import DEFECTS, SEEN_LEVELS
from harmless import HARMLESS, Machine, drawn_by
from subjects import Pixels, Shot

from renderer.study import COMPARISON_METRICS, STRICTNESSES, FrameDifference, exceeded_limits


@dataclass(frozen=True)
class Measured:
    """A change of one subject's picture, in figures.

    passes_at: the strictest level at which it has to pass; None for a defect. bias: of each channel, in steps.
    """

    subject: str
    change: str
    passes_at: str | None
    figures: dict[str, float]
    bias: tuple[float, ...]

    @property
    def is_defect(self) -> bool:
        """Whether it must not pass."""
        return self.passes_at is None

    @property
    def is_seen(self) -> bool:
        """Whether some pixel moves by more than rounding could."""
        return self.figures["largest"] >= SEEN_LEVELS

    def over(self, level: str) -> list[str]:
        """Return the figures over that level's limits."""
        return exceeded_limits(self.figures, STRICTNESSES[level].limits)


def harmless_changes(shot: Shot) -> Iterator[Measured]:
    """Measure the harmless changes that need no other process."""
    for change in HARMLESS:
        picture = change.make(shot)
        if picture is not None:
            yield _measured(shot, change.name, picture, change.level)


def defects(shot: Shot) -> Iterator[Measured]:
    """Measure the defects that change this shot."""
    for defect in DEFECTS:
        picture = defect.inject(shot)
        if picture is not None and not np.array_equal(picture, shot.golden):
            yield _measured(shot, defect.name, picture, None)


def on_machine(shots: Sequence[Shot], machine: Machine, primitive: str) -> tuple[str, list[Measured]]:
    """Return the name of the machine's device and driver, and the measurements of all shots."""
    drawn = drawn_by(machine, primitive)
    return drawn.by, [_measured(shot, machine.name, drawn.pictures[str(shot)], machine.level) for shot in shots]


def _measured(shot: Shot, change: str, picture: Pixels, passes_at: str | None) -> Measured:
    difference = FrameDifference(shot.golden, picture)
    if difference.largest() == 0:  # nearly all machines draw the same picture; the metrics of the eye take their time
        figures = {name: float(figure.higher_is_better) for name, figure in COMPARISON_METRICS.items()}
        return Measured(str(shot), change, passes_at, figures, difference.bias)
    return Measured(str(shot), change, passes_at, difference.metrics(COMPARISON_METRICS), difference.bias)
