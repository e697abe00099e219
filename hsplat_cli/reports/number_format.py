"""Formats numbers for tables, with significant digits only, and absent numbers as `-`."""

from __future__ import annotations

import math

from renderer.accuracy import Metric

ABSENT = "-"


def count_text(count: float) -> str:
    """Format a count, rounded to an integer: `1 194 745`."""
    return f"{count:,.0f}".replace(",", " ") if math.isfinite(count) else ABSENT


def short_count_text(count: float) -> str:
    """Format a count in at most six characters, up to 999 million: `812`, `12.9 k`, `1.19 M`."""
    if not math.isfinite(count):
        return ABSENT
    return _scaled(count, ("", " k", " M", " G", " T")) if round(count) >= 1000 else f"{count:.0f}"


def bytes_text(num_bytes: int | None) -> str:
    """Format a size in powers of 1000: `812 MB`, `1.27 GB`."""
    return ABSENT if num_bytes is None else _scaled(num_bytes, (" B", " kB", " MB", " GB", " TB"))


def ms_text(seconds: float) -> str:
    """Format seconds as milliseconds without the unit, to three digits or an integer: `0.0412`, `8.12`, `1348`."""
    return ratio_text(1000 * seconds) if math.isfinite(seconds) else ABSENT


def metric_text(metric: Metric, value: float) -> str:
    """Format a metric's value: `36.24` for decibels, without the unit; `12.3 %` for a share; else `0.0153`."""
    if math.isnan(value):
        return ABSENT
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    if metric.unit == "dB":
        return f"{value:.2f}"
    if metric.name.endswith("_share"):
        return f"{100 * value:.1f} %"
    return f"{value:.4f}" if value == 0 or abs(value) >= 1e-3 else f"{value:.1e}"


def ratio_text(ratio: float) -> str:
    """Format a number with at least three significant digits, and all digits before the point: `3.24`, `1348`."""
    if ratio == 0:
        return "0"
    magnitude = math.floor(math.log10(abs(float(f"{ratio:.2e}"))))
    return f"{ratio:.{max(2 - magnitude, 0)}f}"


def _scaled(number: float, units: tuple[str, ...]) -> str:
    """Format a number with three digits, in the largest unit, a power of 1000, in which it is at least 1."""
    power = 0
    while power < len(units) - 1 and float(f"{number:.3g}") >= 1000:
        number, power = number / 1000, power + 1
    return f"{ratio_text(number)}{units[power]}"
