"""Define a look, a transfer function from another program, and convert its points to the units of a volume's data."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any

from renderer.looks.curves import OPAQUE_DEPTH, Color, Curve, linear_in_extinction, merge_curves, without_hidden

# The largest number of points of a look.
MAX_LOOK_POINTS = 2**16

# A point of a look: a value, a colour, and an opacity.
LookPoint = tuple[float, Color, float]


@dataclass(frozen=True)
class Look:
    """A transfer function of another program: colours, and perhaps opacities, by value.

    curve: (r, g, b, opacity) or (r, g, b) by value, at least one point, linear between points.
    is_share: whether values are shares of a range, from 0 at its lowest to 1 at its highest value; else data units.
    span: the range of the look's values, which `range` in a scene replaces; None for the first to the last value.
    unit: the world length that opacities refer to; None for about a voxel.
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
        """Return whether the look has opacities, and not colours alone."""
        return len(self.curve[0][1]) == 4


# The looks of a file that has several: by a look's name, a function that makes the look.
Looks = Mapping[str, Callable[[], Look]]


def place_look(
    look: Look,
    *,
    span: tuple[float, float] | None,
    scale: float,
    shift: float,
    opacities: Sequence[tuple[float, float]] | None,
) -> list[LookPoint]:
    """Return the points of a look in data units, sorted by value; colours and extinctions are linear between them.

    span: a range of values that replaces the look's range. scale, shift: each value is multiplied by `scale`, then
    `shift` is added. opacities: pairs (value in data units, opacity), linear in extinction, that replace the look's
    opacities. Without any opacities, the look is opaque. If a value is too large for a float, one point at infinity is
    returned.
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
        # One point more than allowed is enough to report the error; all points might be millions.
        curve = list(islice(linear_in_extinction(curve), MAX_LOOK_POINTS + 1))
    return [(value, (r, g, b), opacity) for value, (r, g, b, opacity) in curve]


def _depth(opacity: float) -> float:
    return min(-math.log1p(-opacity), OPAQUE_DEPTH) if opacity < 1 else OPAQUE_DEPTH
