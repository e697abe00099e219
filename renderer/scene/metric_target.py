"""The accuracy that a search has to reach."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class MetricTarget:
    """A metric of `renderer.study.metrics.METRICS`, over all pixels of each frame, and the value to reach."""

    metric: Literal["psnr", "rmse", "ssim", "flip"]
    value: float

    def __str__(self) -> str:
        return self.format(self.value)

    def format(self, value: float) -> str:
        """Return a value of this metric as text, with name and unit."""
        return f"{self.metric} {value:.2f} dB" if self.metric == "psnr" else f"{self.metric} {value:.4g}"

    def margin(self, value: float) -> float:
        """Return how much better than the target a value is; negative if it is worse, -inf for NaN."""
        margin = value - self.value if self.metric in ("psnr", "ssim") else self.value - value
        return -math.inf if math.isnan(margin) else margin
