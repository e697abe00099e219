"""Write optical depths as the opacities of a scene, with no more digits than can be seen."""

from __future__ import annotations

import math


def opacity_unit_length(diagonal: float) -> float:
    """Return the length that opacities refer to: about 1 % of a volume's diagonal, 1, 2 or 5 times a power of ten."""
    exponent = math.floor(math.log10(diagonal / 100))
    digits = diagonal / 100 / 10.0**exponent
    return float(f"{1 if digits < 1.5 else 2 if digits < 3.5 else 5 if digits < 7.5 else 10}e{exponent}")


def opacity_from_depth(depth: float, diagonal: float) -> float:
    """Return the opacity of a unit length from the optical depth of 1 % of a volume's diagonal.

    The opacity has no more digits than can be seen.
    """
    exact = depth * (opacity_unit_length(diagonal) / (diagonal / 100))
    opacity, clear = -math.expm1(-exact), math.exp(-exact)
    return float(f"{opacity:.3g}") if opacity <= 0.9 else round(1 - float(f"{clear:.2g}"), 6)
