"""The outcome of a comparison, for each frame and for all frames."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from renderer.study import Limits, severity

# `same`: equal pixels. `close`: within the limits. All others fail.
Status = Literal["same", "close", "different", "missing", "extra", "other size", "other channels"]
PASSES: frozenset[Status] = frozenset({"same", "close"})


@dataclass(frozen=True)
class Outcome:
    """The outcome of one pair of frames.

    name: as in Pair. why: one sentence; every number in it has its metric, its unit and its limit.
    figures: errors by the names of COMPARISON_METRICS; empty if nothing can be compared.
    limits: of this frame. exceeded: metrics over their limits, the reason first.
    bias: mean signed error of each channel, in levels, actual minus golden. number: of the frame, if its name has one.
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
        """Whether the frame is within its limits."""
        return self.status in PASSES

    @property
    def severity(self) -> float:
        """The largest error as a multiple of its limit; infinite without a comparable pair."""
        if self.status in ("same", "close", "different"):
            return severity(self.figures, self.limits)
        return math.inf

    @property
    def rank(self) -> tuple[bool, float]:
        """Sort key, worst first: failing frames before passing ones, then by severity."""
        return (self.passes, -self.severity)


@dataclass(frozen=True)
class Comparison:
    """The outcome of all pairs, at least one, in the order of their names.

    golden, actual: what was compared, as text. level: name of the strictness. notes: for the user. facts: both sides of
    a fact such as the driver, by its name: (golden, actual). other_limits: as in `Rules.other_limits`.
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
        """The level, with the limits that replace its own."""
        return f"{self.level} (with other limits: {'; '.join(self.other_limits)})" if self.other_limits else self.level

    @property
    def passes(self) -> bool:
        """Whether every frame passes."""
        return all(outcome.passes for outcome in self.outcomes)

    @property
    def worst_first(self) -> list[Outcome]:
        """The outcomes by `Outcome.rank`, equal ones in the order of their names."""
        return sorted(self.outcomes, key=lambda outcome: outcome.rank)
