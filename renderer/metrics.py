"""How far a picture is from the truth, by the metrics of the field.

Pictures are compared as they are seen: over the scene's background, clipped to [0, 1], before quantisation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Metric:
    """What a figure is called and how it reads.

    name: the field of `Difference`. unit: "dB" or "", for what has none. higher_is_better: PSNR and SSIM.
    """

    name: str
    label: str
    unit: str
    higher_is_better: bool


METRICS = (
    Metric("rmse", "RMSE", "", False),
    Metric("max_error", "largest error", "", False),
    Metric("psnr", "PSNR", "dB", True),
    Metric("ssim", "SSIM", "", True),
    Metric("flip", "FLIP", "", False),
    Metric("flip_p99", "FLIP, 99th percentile", "", False),
    Metric("delta_e_share", "pixels with Delta-E over 2.3", "", False),
)


@dataclass(frozen=True)
class Difference:
    """A picture against the truth, over some pixels; NaN for what is not defined there (SSIM of a tiny picture).

    rmse: root of the mean squared difference of the RGB channels. max_error: largest difference of a channel.
    psnr: `-20 log10 rmse`, dB; infinite for equal pictures.
    ssim: mean structural similarity (Wang et al. 2004). flip, flip_p99: mean and 99th percentile of the perceived
    difference (Andersson et al. 2020), 0 to 1. delta_e_share: share of the pixels whose CIE 1976 colour difference is
    over 2.3, the just noticeable one.
    """

    rmse: float
    max_error: float
    psnr: float
    ssim: float
    flip: float
    flip_p99: float
    delta_e_share: float


@dataclass(frozen=True)
class Accuracy:
    """A picture against the truth: over all pixels, and over those in which the truth has anything of the volume."""

    everywhere: Difference
    on_volume: Difference
