"""Numbers and names as they stand in messages and reports."""

from __future__ import annotations

import math
from collections.abc import Iterable

from renderer.study import COMPARISON_METRICS


def figure_text(name: str, value: float, limit: float) -> str:
    """`largest error of a channel 7 levels, at most 1`."""
    text = value_text(name, value, limit)
    amount = " ".join(filter(None, (text, _unit(name, text))))
    return f"{COMPARISON_METRICS[name].label} {amount}, {limit_text(name, limit)}"


def value_text(name: str, value: float, limit: float) -> str:
    """With three digits, or with as many as it takes to see on which side of its limit the value is."""
    texts = (f"{value:.{num_digits}g}" for num_digits in range(3, 18))
    return next(text for text in texts if _side(name, float(text), limit) == _side(name, value, limit))


def limit_text(name: str, limit: float) -> str:
    """`at most 4`, `at least 0.99`."""
    return f"{'at least' if COMPARISON_METRICS[name].higher_is_better else 'at most'} {number_text(limit)}"


def number_text(number: float) -> str:
    """With as many digits as it takes to tell it from any other: `4`, `0.99`, `0.12345678`."""
    text = f"{number:g}"
    return text if float(text) == number else repr(number)


def limits_text(name: str, limits: Iterable[float]) -> str:
    """What a figure is, and its limit if all frames have the same: `largest error of a channel, at most 4 levels`."""
    first, *others = sorted(set(limits))
    if others:
        return f"{COMPARISON_METRICS[name].label}, each frame with a limit of its own"
    return " ".join(
        filter(None, (f"{COMPARISON_METRICS[name].label},", limit_text(name, first), _unit(name, number_text(first))))
    )


def signed_text(value: float) -> str:
    """`+0.12`, `−3`, with a true minus sign, and `0`."""
    return f"{value:+.3g}".replace("-", "−") if value else "0"


def share_text(share: float) -> str:
    """How many times its limit an error is: `0.25`, `12.3`, `∞`."""
    return "∞" if math.isinf(share) else f"{share:.3g}"


def _unit(name: str, text: str) -> str:
    """As it follows a number."""
    return COMPARISON_METRICS[name].unit.removesuffix("s") if text == "1" else COMPARISON_METRICS[name].unit


def _side(name: str, value: float, limit: float) -> bool:
    return COMPARISON_METRICS[name].passes(value, limit)


def printable(text: str) -> str:
    """Text on one line, without a character that a terminal or XML cannot show; bytes that are no UTF-8 as `\\xff`."""
    return "".join(letter if letter.isprintable() else _escaped(letter) for letter in text)


def _escaped(letter: str) -> str:
    if "\udc80" <= letter <= "\udcff":  # how Python has a byte that it cannot decode (PEP 383)
        return f"\\x{ord(letter) - 0xDC00:02x}"
    return letter.encode("unicode_escape").decode("ascii")
