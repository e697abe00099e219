"""Choose round numbers, 1, 2 or 5 times a power of ten, and write them without rounding errors."""

from __future__ import annotations

import math
from decimal import Decimal

# The first digits of round numbers.
_MANTISSAS = (1, 2, 5)
# The metric units in which lengths are written, each by its length in metres, as a power of ten: -3 for mm.
_PREFIXES = {-12: "pm", -9: "nm", -6: "µm", -3: "mm", 0: "m", 3: "km"}
# The metric units that a volume may have, each with its length in metres, as a power of ten: -2 for cm.
_UNITS = {unit: power for power, unit in _PREFIXES.items()} | {"cm": -2, "um": -6, "\u03bcm": -6}
# Numbers with more digits than this before the decimal point are written with a power of ten.
_MOST_DIGITS = 6
# Numbers whose first digit other than 0 is later than this after the decimal point are written with a power of ten.
_MOST_DECIMALS = 5


def round_below(limit: float) -> Decimal:
    """Return the largest round number that is at most `limit`, which is above 0."""
    power = math.floor(math.log10(limit))
    candidates = [Decimal(n).scaleb(e) for e in (power - 1, power, power + 1) for n in _MANTISSAS]
    return max(number for number in candidates if number <= Decimal(limit) * (1 + Decimal("1e-9")))


def plain_text(number: Decimal) -> str:
    """Return a number as text, exactly; very large and very small numbers are written with a power of ten."""
    number = number.normalize()
    if number and not -_MOST_DECIMALS <= number.adjusted() < _MOST_DIGITS:
        mantissa = number.scaleb(-number.adjusted())
        return f"{mantissa:f}e{number.adjusted()}".replace("-", "\u2212")
    return f"{number:f}".replace("-", "\u2212")


def length_text(length: Decimal, unit: str) -> str:
    """Return a length as text with its unit; a metric unit is replaced by the largest unit in which it is at least 1.

    length: the number of units. unit: the name of the unit.
    """
    if unit not in _UNITS:
        return f"{plain_text(length)} {unit.removesuffix('s') if length == 1 and unit == 'voxels' else unit}".rstrip()
    metres = length.scaleb(_UNITS[unit])
    power = max((power for power in _PREFIXES if metres >= Decimal(1).scaleb(power)), default=-12)
    return f"{plain_text(metres.scaleb(-power))} {_PREFIXES[power]}"


def find_ticks(low: float, high: float, most: int, *, is_log: bool = False) -> list[Decimal]:
    """Return the ticks of an axis from `low` to `high`: evenly spaced round numbers, at most `most` of them.

    is_log: whether the axis is logarithmic, with powers of ten as ticks where they fit.
    """
    if not low < high:
        return [Decimal(repr(low))]
    if is_log and low > 0 and len(ticks := _log_ticks(low, high, most)) > 1:
        return ticks
    step = round_below((high - low) / max(most - 1, 1))
    while True:
        margin = 1e-6 * (high - low)
        first, last = math.ceil((low - margin) / float(step)), math.floor((high + margin) / float(step))
        if last - first < most:
            return [step * number for number in range(first, last + 1)]
        step = round_below(float(step) * 2.6)


def _log_ticks(low: float, high: float, most: int) -> list[Decimal]:
    """Return the ticks of a logarithmic axis from `low` to `high`, at most `most` of them.

    They are 1, 2 and 5 times powers of ten; if these are too many, powers of ten, or every second power, or every third
    power, and so on.
    """
    powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for mantissas, stride in ((_MANTISSAS, 1), *(((1,), stride) for stride in range(1, len(powers) + 1))):
        numbers = (Decimal(n).scaleb(power) for power in powers if power % stride == 0 for n in mantissas)
        ticks = [number for number in numbers if low * (1 - 1e-9) <= number <= high * (1 + 1e-9)]
        if len(ticks) <= most:
            return ticks
    return []
