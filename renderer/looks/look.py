"""Hold a look, and place its points at the values of a scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from renderer.looks.curves import OPAQUE_DEPTH, Color, Curve, linear_in_extinction, merge_curves, without_hidden

# The most points of a look.
MAX_LOOK_POINTS = 2**16

# A value, a colour, and an opacity.
LookPoint = tuple[float, Color, float]


@dataclass(frozen=True)
class Look:
    """A transfer function of another program: colours, and perhaps opacities, by value.

    curve: (r, g, b, opacity) or (r, g, b) by value, at least one point; colours and opacities are linear in between.
    is_share: whether values are shares of a range, from 0 at its lowest to 1 at its highest value; else data units.
    span: the range that `range` in a scene replaces; None for the range from the first to the last value.
    unit: the world length of the opacities; None for about a voxel.
    shading: the keys of a scene's `shading` that give the light of the file; empty if the file has no light.
    left_out: clauses on features of the file that hsplat lacks.
    """

    curve: Curve
    is_share: bool = False
    span: tuple[float, float] | None = None
    unit: float | None = None
    shading: Mapping[str, Any] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()

    @property
    def has_opacities(self) -> bool:
        """Return whether colours have opacities."""
        return len(self.curve[0][1]) == 4


# Functions that make the looks of a file with several looks, by name.
Looks = Mapping[str, Callable[[], Look]]


def place_look(
    look: Look,
    *,
    span: tuple[float, float] | None,
    scale: float,
    shift: float,
    opacities: Sequence[tuple[float, float]] | None,
) -> list[LookPoint]:
    """Return the points of a look in data units, sorted by value, for interpolating colours and extinctions.

    span: the range that replaces the look's own. scale, shift: the factor on values, and the number that is added then.
    opacities: pairs of value and opacity in data units, linear in extinction, that replace the look's own. If neither
    has opacities, they are 1. Values that are too large for a float become infinite.
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
        # A point more than allowed is enough for the error; there might be millions of points.
        curve = list(islice(linear_in_extinction(curve), MAX_LOOK_POINTS + 1))
    return [(value, (r, g, b), opacity) for value, (r, g, b, opacity) in curve]


def _depth(opacity: float) -> float:
    return min(-math.log1p(-opacity), OPAQUE_DEPTH) if opacity < 1 else OPAQUE_DEPTH
