"""Write values and shares as text."""

from __future__ import annotations


def format_number(value: float) -> str:
    """Return a number as text, whole numbers without a decimal point."""
    return str(int(value)) if value == int(value) and abs(value) < 2**53 else f"{value:g}"


def format_percent(part: float) -> str:
    """Return a share as text, a percentage with two digits; a share of less than half a millionth is 0 %."""
    return f"{100 * part:.0f} %" if part >= 0.0995 else f"{100 * round(part, 6):.2g} %"
