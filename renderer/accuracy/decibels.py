"""Convert mean squared errors, of colours in [0, 1], to decibels and back."""

from __future__ import annotations

import math

from renderer.scene import MetricTarget

# The mean squared error of rounding colours in [0, 1] to 8 bits.
ROUNDING_ERROR = 1 / 12 / 255**2
# The largest PSNR that is written down, in decibels, in place of larger ones and of infinity, the PSNR of equal
# pictures.
MOST_DB = 200.0


def psnr(mean_squared_error: float) -> float:
    """Return the peak signal-to-noise ratio in decibels; infinity if the error is 0, or an estimate below 0."""
    return math.inf if mean_squared_error <= 0 else -10 * math.log10(mean_squared_error)


def squared_error(decibels: float) -> float:
    """Return the mean squared error of a peak signal-to-noise ratio; 0 from MOST_DB on."""
    return float(10 ** (-decibels / 10)) if decibels < MOST_DB else 0.0


def wanted_error(want: MetricTarget) -> float:
    """Return the mean squared error of a wanted PSNR or RMSE."""
    return squared_error(want.value) if want.metric == "psnr" else want.value**2
