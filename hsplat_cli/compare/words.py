"""Numbers and names as they stand in messages and reports."""

from __future__ import annotations

from renderer.frame_difference import FIGURES


def figure_text(name: str, value: float, limit: float) -> str:
    """`largest error of a channel 7 levels, at most 1`.

    With three digits, or with as many as it takes to see on which side of its limit the value is.
    """
    figure = FIGURES[name]
    digits = next(
        text
        for text in (f"{value:.{k}g}" for k in range(3, 18))
        if _side(name, float(text), limit) == _side(name, value, limit)
    )
    unit = figure.unit.removesuffix("s") if digits == "1" else figure.unit
    bound = "at least" if figure.higher_is_better else "at most"
    return f"{figure.label} {' '.join(filter(None, (digits, unit)))}, {bound} {limit:g}"


def _side(name: str, value: float, limit: float) -> bool:
    return FIGURES[name].passes(value, limit)


def printable(text: str) -> str:
    """Text on one line, without a character that a terminal or XML cannot show; bytes that are no UTF-8 as `\\xff`."""
    return "".join(letter if letter.isprintable() else _escaped(letter) for letter in text)


def _escaped(letter: str) -> str:
    if "\udc80" <= letter <= "\udcff":  # how Python has a byte that it cannot decode (PEP 383)
        return f"\\x{ord(letter) - 0xDC00:02x}"
    return letter.encode("unicode_escape").decode("ascii")


def count_text(count: int, one: str, more: str | None = None) -> str:
    """`1 frame`, `2 frames`."""
    return f"{count} {one if count == 1 else more or f'{one}s'}"
