"""What a look is, and its points where the scene wants them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from renderer.looks.curves import OPAQUE_DEPTH, Color, Curve, linear_in_extinction, merge_curves, without_hidden

MAX_LOOK_POINTS = 2**16
# A value, a colour, and an opacity in place of None.
LookPoint = tuple[float, Color, float]


@dataclass(frozen=True)
class Look:
    """Colours and opacities by value.

    curve: (r, g, b, opacity) or (r, g, b) by value, at least one point; linear in between, opacities too.
    is_share: values are shares of a range, 0 its lowest and 1 its highest value; else they are in data units.
    span: what `range` in a scene replaces; None is from the first to the last value.
    unit: the world length that opacities are for; None for about a voxel.
    shading: what a scene's `shading` would say to be lit as in the file; empty where the file has no light.
    left_out: clauses on what the file has and hsplat has not.
    """

    curve: Curve
    is_share: bool = False
    span: tuple[float, float] | None = None
    unit: float | None = None
    shading: Mapping[str, Any] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()

    @property
    def has_opacities(self) -> bool:
        """Return whether its colours have opacities."""
        return len(self.curve[0][1]) == 4


# The looks of a file with several, by name, each made when it is chosen.
Looks = Mapping[str, Callable[[], Look]]


def place_look(
    look: Look,
    *,
    span: tuple[float, float] | None,
    scale: float,
    shift: float,
    opacities: Sequence[tuple[float, float]] | None,
) -> list[LookPoint]:
    """Return the points of a look in data units, by value, of which hsplat interpolates colours and extinctions.

    span: the range in place of the look's own, then values are multiplied by `scale`, and `shift` is added.
    opacities: (value, opacity) in data units in place of the look's own, linear in extinction; without any, of either,
    opacities are 1. Values may be too large for a float.
    """
    first, last = (0.0, 1.0) if look.is_share else look.span or (look.curve[0][0], look.curve[-1][0])
    low, high = span or (first, last)
    stretch = (high - low) / (last - first) if last > first else 1.0

    def placed(value: float) -> float:
        return scale * (value if span is None else low + stretch * (value - first)) + shift

    curve = without_hidden([(placed(value), parts) for value, parts in look.curve])
    if not all(math.isfinite(value) for value, _ in curve):
        return [(math.inf, (0.0, 0.0, 0.0), 0.0)]
    if opacities or not look.has_opacities:
        depths = [(value, (_depth(opacity),)) for value, opacity in opacities or [(curve[0][0], 1.0)]]
        merged = merge_curves([(value, parts[:3]) for value, parts in curve], depths)
        curve = [(value, (*parts[:3], -math.expm1(-parts[3]))) for value, parts in merged]
    else:
        # One more than is allowed is refused; without an end they may be millions.
        curve = list(islice(linear_in_extinction(curve), MAX_LOOK_POINTS + 1))
    return [(value, (r, g, b), opacity) for value, (r, g, b, opacity) in curve]


def _depth(opacity: float) -> float:
    return min(-math.log1p(-opacity), OPAQUE_DEPTH) if opacity < 1 else OPAQUE_DEPTH
