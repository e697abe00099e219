"""Format errors, limits and names for messages and reports."""

from __future__ import annotations

import math
from collections.abc import Iterable

from renderer.study import COMPARISON_METRICS


def figure_text(name: str, value: float, limit: float) -> str:
    """Format a metric: `largest error of a channel 7 levels, at most 1`."""
    text = value_text(name, value, limit)
    amount = " ".join(filter(None, (text, _unit(name, text))))
    return f"{COMPARISON_METRICS[name].label} {amount}, {limit_text(name, limit)}"


def value_text(name: str, value: float, limit: float) -> str:
    """Format a value with three digits, or with enough to show on which side of its limit it is."""
    texts = (f"{value:.{num_digits}g}" for num_digits in range(3, 18))
    return next(text for text in texts if _side(name, float(text), limit) == _side(name, value, limit))


def limit_text(name: str, limit: float) -> str:
    """Format a limit: `at most 4`, `at least 0.99`."""
    return f"{'at least' if COMPARISON_METRICS[name].higher_is_better else 'at most'} {number_text(limit)}"


def number_text(number: float) -> str:
    """Format a number with as many digits as needed to read it back: `4`, `0.99`, `0.12345678`."""
    text = f"{number:g}"
    return text if float(text) == number else repr(number)


def limits_text(name: str, limits: Iterable[float]) -> str:
    """Name a metric and its limit, if all frames share it: `largest error of a channel, at most 4 levels`."""
    first, *others = sorted(set(limits))
    if others:
        return f"{COMPARISON_METRICS[name].label}, limits differ between frames"
    return " ".join(
        filter(None, (f"{COMPARISON_METRICS[name].label},", limit_text(name, first), _unit(name, number_text(first))))
    )


def signed_text(value: float) -> str:
    """Format a signed number, with a true minus sign: `+0.12`, `−3`, `0`."""
    return f"{value:+.3g}".replace("-", "−") if value else "0"


def share_text(share: float) -> str:
    """Format an error as a multiple of its limit: `0.25`, `12.3`, `∞`."""
    return "∞" if math.isinf(share) else f"{share:.3g}"


def _unit(name: str, text: str) -> str:
    return COMPARISON_METRICS[name].unit.removesuffix("s") if text == "1" else COMPARISON_METRICS[name].unit


def _side(name: str, value: float, limit: float) -> bool:
    return COMPARISON_METRICS[name].passes(value, limit)
