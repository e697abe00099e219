"""Recognise computed tomography in Hounsfield units by its histogram."""

from __future__ import annotations

from renderer.statistics.histogram import Statistics
from renderer.volume import Float64

# The stored values that may stand for 0 Hounsfield units: 0, or an offset by which files keep 12-bit values positive.
_HOUNSFIELD_ZEROS = (0.0, 1024.0, 1000.0)


def hounsfield_zero(statistics: Statistics) -> float | None:
    """Return the stored value of 0 Hounsfield units: 0, 1000 or 1024; None if the values are no Hounsfield units.

    In a scan, air and lungs (-1100 to -700) and soft tissue (-150 to 150) are much more frequent than the values
    between them (-600 to -300), and something is denser. Values below -1100 are padding around the scanner's circle.
    """
    low, high = float(statistics.minimum), float(statistics.maximum)
    for zero in _HOUNSFIELD_ZEROS:
        is_possible = (zero == 0) == (low < -200) and 150 < high - zero < 40_000 and low - zero >= -9000
        if not is_possible or (zero and high > 5200):
            continue
        values = statistics.bins - zero
        air, between, soft = (
            float(statistics.counts[(values >= a) & (values < b)].sum()) / (b - a)
            for a, b in ((-1100, -700), (-600, -300), (-150, 150))
        )
        has_peaks = min(air, soft) > 1.5 * between and soft * 300 > 0.01 * float(statistics.counts.sum())
        if has_peaks and (zero == 0 or _is_narrow(statistics, values)):
            return zero
    return None


def _is_narrow(statistics: Statistics, values: Float64) -> bool:
    """Return whether soft tissue has a narrow peak: over half of the values from -300 to 300 lie in a range of 150.

    values: the Hounsfield units of the bins of the histogram.
    """
    counts = [float(statistics.counts[(values >= a) & (values < a + 50)].sum()) for a in range(-300, 300, 50)]
    widest = max(sum(counts[k : k + 3]) for k in range(len(counts) - 2))
    return widest > 0.5 * sum(counts) > 0
