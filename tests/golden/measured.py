"""Compute every figure of a comparison for every change of a frame, harmless ones and defects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from defects import SEEN_LEVELS
from harmless import Machine, drawn_by
from subjects import Change, Pixels, Shot

from hsplat_cli.compare import COMPARISON_METRICS, STRICTNESSES, FrameDifference, exceeded_limits


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


def measured(shot: Shot, change: Change) -> Measured | None:
    """Measure a change of a shot; None where there is nothing to change, or a defect that changes nothing."""
    picture = change.picture(shot)
    if picture is None or (change.level is None and np.array_equal(picture, shot.golden)):
        return None
    return _measured(shot, change.name, picture, change.level)


def on_machine(shots: Sequence[Shot], machine: Machine, primitive: str) -> tuple[str, list[Measured]]:
    """Return the name of the machine's device and driver, and the measurements of all shots."""
    by, pictures = drawn_by(machine, primitive)
    return by, [_measured(shot, machine.name, pictures[str(shot)], machine.level) for shot in shots]


def _measured(shot: Shot, change: str, picture: Pixels, passes_at: str | None) -> Measured:
    difference = FrameDifference(shot.golden, picture)
    if difference.largest() == 0:  # nearly all machines draw the same picture; the metrics of the eye take their time
        figures = {name: float(figure.higher_is_better) for name, figure in COMPARISON_METRICS.items()}
        return Measured(str(shot), change, passes_at, figures, difference.bias)
    return Measured(str(shot), change, passes_at, difference.metrics(COMPARISON_METRICS), difference.bias)
