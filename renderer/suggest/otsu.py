"""Split a histogram into two classes of values.

N. Otsu, "A Threshold Selection Method from Gray-Level Histograms", IEEE Trans. SMC 9(1), 1979.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt


def otsu_bin(counts: npt.NDArray[np.int64]) -> tuple[int, float] | None:
    """Return the first bin of the upper class and the part of the variance that is between the classes.

    counts: [n], by bin. The threshold has the largest variance between its two sides; it is then moved to the least
    populated bin between the medians of the sides. None if fewer than two bins are occupied.
    """
    if np.count_nonzero(counts) < 2:
        return None
    weight, position = counts.astype(np.float64), np.arange(len(counts), dtype=np.float64)
    below, moment = np.cumsum(weight)[:-1], np.cumsum(weight * position)[:-1]
    total, mean = weight.sum(), float(weight @ position) / weight.sum()
    divides = (below > 0) & (below < total)
    between = np.zeros(len(below))
    between[divides] = (moment - mean * below)[divides] ** 2 / (below * (total - below))[divides]
    best = int(between.argmax()) + 1
    variance = float(weight @ (position - mean) ** 2) / total
    first = int(np.searchsorted(np.cumsum(weight[:best]), weight[:best].sum() / 2))
    last = best + int(np.searchsorted(np.cumsum(weight[best:]), weight[best:].sum() / 2))
    # A box of five bins keeps single empty bins of stretched data from passing for a valley.
    smooth = np.convolve(np.pad(weight, 2, mode="edge"), np.full(5, 0.2), mode="valid")[first + 1 : last + 1]
    lowest = np.flatnonzero(smooth <= smooth.min() * (1 + 1e-9))
    return first + 1 + int(lowest[len(lowest) // 2]), float(between.max()) / variance
