"""What came of a comparison: of each frame, and of all of them. What the reports are written from."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from renderer.study import Limits, severity

# `same`: pixel by pixel. `close`: within the limits. The others fail.
Status = Literal["same", "close", "different", "missing", "extra", "other size", "other channels"]
PASSES: frozenset[Status] = frozenset({"same", "close"})


@dataclass(frozen=True)
class Outcome:
    """Of one pair of frames.

    name: of the pair, as the files have it, or `frame 12` of a film.
    why: one sentence; every number in it with its figure, its unit and its limit.
    figures: by name, as `renderer.study.comparison.COMPARISON_METRICS`; none where there is nothing to compare.
    limits: that this frame had. exceeded: figures that are over theirs, the first of them the reason.
    bias: mean signed error of each channel, in levels, actual minus golden.
    number: of the frame, where its name tells.
    """

    name: str
    status: Status
    why: str
    figures: Mapping[str, float] = field(default_factory=dict)
    limits: Limits = field(default_factory=dict)
    exceeded: Sequence[str] = ()
    bias: Sequence[float] = ()
    number: int | None = None

    @property
    def passes(self) -> bool:
        """Whether the frame is as it should be."""
        return self.status in PASSES

    @property
    def severity(self) -> float:
        """To sort by, worst first: how many times over its limit it is, infinite where there is no pair."""
        if self.status in ("same", "close", "different"):
            return severity(self.figures, self.limits)
        return math.inf

    @property
    def rank(self) -> tuple[bool, float]:
        """To sort by, worst first: what fails before what passes, then by severity."""
        return (self.passes, -self.severity)


@dataclass(frozen=True)
class Comparison:
    """Of all pairs, at least one of them, in the order of their names.

    golden, actual: what was compared, in words for reports. level: name of the strictness. notes: what the user should
    know. facts: about both sides, such as the driver, by name: (golden, actual). other_limits: than the level's, in
    words as `Rules.other_limits`.
    """

    golden: str
    actual: str
    level: str
    outcomes: Sequence[Outcome]
    notes: Sequence[str] = ()
    facts: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    other_limits: Sequence[str] = ()

    @property
    def strictness(self) -> str:
        """The level, which is not named without the limits that are other ones."""
        return f"{self.level} (with other limits: {'; '.join(self.other_limits)})" if self.other_limits else self.level

    @property
    def passes(self) -> bool:
        """Whether every frame does."""
        return all(outcome.passes for outcome in self.outcomes)

    @property
    def worst_first(self) -> list[Outcome]:
        """By `Outcome.rank`, equals in the order of their names."""
        return sorted(self.outcomes, key=lambda outcome: outcome.rank)


@dataclass(frozen=True)
class Failure:
    """Of what could not be compared. golden, actual: as they were given. why: in one line or several."""

    golden: str
    actual: str
    why: str
