"""An accuracy that is wanted, and how near to it a value comes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class MetricTarget:
    """A metric of `renderer.study.metrics.METRICS`, over all pixels of each frame, and the value to be reached."""

    metric: Literal["psnr", "rmse", "ssim", "flip"]
    value: float

    def __str__(self) -> str:
        return self.format(self.value)

    def format(self, value: float) -> str:
        """A value of this metric with its name and unit."""
        return f"{self.metric} {value:.2f} dB" if self.metric == "psnr" else f"{self.metric} {value:.4g}"

    def margin(self, value: float) -> float:
        """How much better than wanted a value is; negative where it is worse, or no number."""
        margin = value - self.value if self.metric in ("psnr", "ssim") else self.value - value
        return -math.inf if math.isnan(margin) else margin
