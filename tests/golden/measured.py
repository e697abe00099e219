"""Measure changes of a frame's picture, harmless ones and defects, and tell which limits they pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from defects import SEEN_LEVELS
from harmless import Machine, drawn_by
from subjects import Change, Pixels, Shot

from hsplat_cli.compare import Figures, Limit, measure_difference, parse_rules


@dataclass(frozen=True)
class Measured:
    """A change of one subject's picture.

    limit: the strictest limit at which it has to pass; None for a defect. figures: of its difference from the golden.
    stated: the accuracy that the golden and the picture state, in dB.
    """

    subject: str
    change: str
    limit: str | None
    figures: Figures
    stated: tuple[float, float]

    @property
    def is_defect(self) -> bool:
        """Whether it must not pass."""
        return self.limit is None

    @property
    def is_seen(self) -> bool:
        """Whether some pixel moves by more than rounding could."""
        return self.figures.largest >= SEEN_LEVELS

    def passes(self, limit: str) -> bool:
        """Return whether the picture passes at a limit."""
        return _limit(limit).passes(self.figures, self.stated)


def _limit(text: str) -> Limit:
    limit = parse_rules(None, text).limit
    assert limit is not None
    return limit


def measured(shot: Shot, change: Change) -> Measured | None:
    """Measure a change of a shot; None where there is nothing to change, or a defect that changes nothing."""
    picture = change.picture(shot)
    if picture is None or (change.limit is None and np.array_equal(picture, shot.golden)):
        return None
    return _measured(shot, change.name, picture, change.limit, is_in_scene=change.is_in_scene)


def on_machine(shots: Sequence[Shot], machine: Machine, primitive: str) -> tuple[str, list[Measured]]:
    """Return the name of the machine's device and driver, and the measurements of all shots."""
    by, pictures = drawn_by(machine, primitive)
    return by, [_measured(shot, machine.name, pictures[str(shot)], machine.limit) for shot in shots]


def _measured(shot: Shot, change: str, picture: Pixels, limit: str | None, *, is_in_scene: bool = False) -> Measured:
    figures = measure_difference(shot.golden, picture)
    golden = shot.stated_by_golden
    stated = golden if is_in_scene or figures.is_same else shot.stated(picture)
    return Measured(str(shot), change, limit, figures, (golden, stated))
