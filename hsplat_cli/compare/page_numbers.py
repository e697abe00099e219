"""Figures, limits and shares of limits as they stand on the page."""

from __future__ import annotations

import math
from collections.abc import Iterable

from renderer.frame_difference import FIGURES

_MOST_DIGITS = 17


def value_text(value: float, limit: float | None = None) -> str:
    """Three significant digits, and more where it would look the same as its limit and is not."""
    for digits in range(3, _MOST_DIGITS):
        text = f"{value:.{digits}g}"
        if limit is None or value == limit or text != f"{limit:.{digits}g}":
            return text
    return repr(value)


def limit_text(name: str, limit: float) -> str:
    """`at most 4`, `at least 0.99`: of a figure, by its name."""
    return f"{'at least' if FIGURES[name].higher_is_better else 'at most'} {limit:g}"


def signed_text(value: float) -> str:
    """`+0.12`, `-3`, `0`, with a true minus sign."""
    return f"{value:+.3g}".replace("-", "−") if value else "0"


def share_text(share: float) -> str:
    """How many times its limit an error is: `0.25`, `12.3`, `∞`."""
    return "∞" if math.isinf(share) else f"{share:.3g}"


def curve_words(name: str, limits: Iterable[float]) -> str:
    """What a figure is, and its limit where all frames have the same."""
    figure, different = FIGURES[name], sorted(set(limits))
    unit = f" {figure.unit}" if figure.unit else ""
    if len(different) > 1:
        return f"{figure.label}, each frame with a limit of its own"
    return f"{figure.label}, {limit_text(name, different[0])}{unit}"
