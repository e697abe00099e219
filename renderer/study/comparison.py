"""Compare a picture of 8 bits with its golden frame: the metrics, their limits, and what exceeds them.

Most metrics are in levels, of which a channel has 255. If a picture has alpha, a colour is weighted by its opacity, in
the more opaque of both pictures, and alpha is a channel beside the colours. Premultiplied colours would count a change
of alpha twice: a colour and an alpha that are each rounded by one level differently would differ by up to two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.study.metrics import REACH_PX, SSIM_WINDOW_PX, Metric, metric_map

Pixels = npt.NDArray[np.uint8]
Limits = Mapping[str, float]  # by the name of the metric

WINDOW_PX = 8

_UNITS_PER_LEVEL = 255  # errors are exact in 255ths of a level: a level at an opacity of 1
# Perceptual metrics are computed in squares of this size: all of a large picture would take gigabytes.
_BLOCK_PX = 256

_Block = tuple[slice, slice]

# In the order in which they are checked: the first one that exceeds its limit is given as the reason.
COMPARISON_METRICS = {
    metric.name: metric
    for metric in (
        Metric("largest", "largest error of a channel", "levels"),
        Metric("p99", "99th percentile of the pixels' largest errors", "levels"),
        Metric("flip", "mean FLIP"),
        Metric("ssim", "mean SSIM", higher_is_better=True),
        Metric(
            "densest", f"mean error of a channel in the densest window of {WINDOW_PX} x {WINDOW_PX} pixels", "levels"
        ),
        Metric("bias", "mean signed error of the most shifted channel", "levels"),
    )
}


class FrameDifference:
    """The difference of a picture, `actual`, from another of the same shape.

    Both are uint8 [h, w, 3] or, with straight alpha, [h, w, 4].
    """

    def __init__(self, golden: Pixels, actual: Pixels) -> None:
        assert golden.shape == actual.shape and golden.dtype == actual.dtype == np.uint8, (golden.shape, actual.shape)
        self._golden, self._actual = golden, actual
        self._signed_errors = _signed_errors_in_255ths(golden, actual)

    @property
    def signed_levels(self) -> npt.NDArray[np.float32]:
        """Return float32 [h, w]: the signed error of each pixel's worst channel, actual minus golden, in levels."""
        largest = np.abs(self._signed_errors).argmax(axis=2)[..., None]
        levels = np.take_along_axis(self._signed_errors, largest, axis=2)[..., 0].astype(np.float32)
        levels /= _UNITS_PER_LEVEL
        return levels

    @property
    def bias(self) -> tuple[float, ...]:
        """Return the mean signed error of each channel, actual minus golden, in levels."""
        return tuple((self._signed_errors.mean(axis=(0, 1)) / _UNITS_PER_LEVEL).tolist())

    def metrics(self, names: Iterable[str]) -> dict[str, float]:
        """Compute these of COMPARISON_METRICS, in their order; without SSIM if a picture is smaller than its window.

        FLIP needs the package flip-evaluator, SSIM scikit-image.
        """
        wanted = set(names)
        assert wanted <= set(COMPARISON_METRICS), wanted
        functions: dict[str, Callable[[], float]] = {
            "largest": self.largest,
            "p99": self.p99,
            "flip": partial(self.perceptual_metric, "flip"),
            "ssim": partial(self.perceptual_metric, "ssim"),
            "densest": self.densest,
            "bias": lambda: max(map(abs, self.bias)),
        }
        found = {name: functions[name]() for name in COMPARISON_METRICS if name in wanted}
        return {name: value for name, value in found.items() if not math.isnan(value)}

    def largest(self) -> float:
        """Return the largest error over all pixels and channels, in levels."""
        return max(int(self._signed_errors.max()), -int(self._signed_errors.min())) / _UNITS_PER_LEVEL

    def p99(self) -> float:
        """Return the 99th percentile of the error of each pixel's worst channel, in levels."""
        return float(np.percentile(np.abs(self._signed_errors).max(axis=2), 99)) / _UNITS_PER_LEVEL

    def densest(self) -> float:
        """Return the largest mean error of a channel in a square of WINDOW_PX pixels, or what fits of it.

        It shows many small errors that are close together.
        """
        errors = np.abs(self._signed_errors)
        sums = [_largest_window_sum(errors[..., channel]) for channel in range(errors.shape[2])]
        height, width = (min(WINDOW_PX, length) for length in errors.shape[:2])
        return float(max(sums) / (_UNITS_PER_LEVEL * height * width))

    def perceptual_metric(self, name: str) -> float:
        """Return SSIM or FLIP of the pictures; of transparent ones over black or white, whichever is worse."""
        height, width, channels = self._golden.shape
        if name == "ssim" and min(height, width) < SSIM_WINDOW_PX:
            return math.nan
        perfect = float(COMPARISON_METRICS[name].higher_is_better)
        errors = [0.0] if channels == 3 else [0.0, 0.0]  # over black, over white
        for around, cut in _blocks(height, width):
            if self._signed_errors[around].any():
                for ground in range(len(errors)):
                    actual, golden = _over(self._actual[around], ground), _over(self._golden[around], ground)
                    errors[ground] += float(np.sum(np.abs(metric_map(name, actual, golden)[cut] - perfect)))
        return float(abs(perfect - max(errors) / (height * width)))


@dataclass(frozen=True)
class Strictness:
    """A named set of limits. purpose: when to use it, in one sentence."""

    name: str
    purpose: str
    limits: Limits


# docs/benchmarks/goldens.md has each metric beside changes that must pass and defects that must not, in frames of
# eleven kinds with splats and of ten with bricks. At `same-machine` must pass: other numbers of threads and vectors of
# 128 to 512 bits, which change nothing, and one value in a thousand rounded differently: densest 0.047, FLIP 0.0003,
# bias 0.0008. At `cross-driver`, with splats: softpipe, Mesa of 2021 and of 2025, zink, a processor without AVX, which
# stay at 1 level and densest 0.02, except that softpipe draws a splat that the near plane cuts 4 levels off, with 0.66;
# with bricks: llvmpipe, softpipe and a processor without AVX, which change nothing, and rays moved by 0.0001 pixels: 2
# levels, densest 0.05; with both: one value in five rounded differently: densest 0.45, FLIP 0.009, bias 0.10. Others
# have seen up to 3 levels between processors. Limits that are not whole numbers leave a factor of at least 1.29. In
# return, a change of a pixel by 2 levels always fails at `same-machine`; the page lists what levels cannot see, too.
STRICTNESS_LEVELS = {
    level.name: level
    for level in (
        Strictness(
            "exact",
            "the same picture, but for colours at an alpha of 0: one program, one driver, one kind of processor",
            {"largest": 0.0},
        ),
        Strictness(
            "same-machine",
            "one driver and one kind of processor: here and there another rounding, by one level",
            {"largest": 1.0, "p99": 0.0, "flip": 0.001, "densest": 0.1, "bias": 0.01},
        ),
        Strictness(
            "cross-driver",
            "another driver, version or processor: small differences everywhere, and no more than that",
            {"largest": 5.0, "p99": 1.0, "flip": 0.012, "densest": 0.85, "bias": 0.15},
        ),
    )
}


def exceeded_limits(values: Mapping[str, float], limits: Limits) -> list[str]:
    """Return the names of the metrics that are not within their limits, in the order of COMPARISON_METRICS."""
    return [
        name
        for name, metric in COMPARISON_METRICS.items()
        if name in values and name in limits and not metric.passes(values[name], limits[name])
    ]


# The unit of an error whose limit allows nothing: a level, and about its equivalent for the eye.
_UNIT_ERRORS = {"levels": 1.0, "": 0.01}


def severity(values: Mapping[str, float], limits: Limits) -> float:
    """Return the largest ratio of an error to what its limit allows.

    If a limit allows nothing, an error of n levels, or n hundredths of FLIP and SSIM, counts as 1 + n: it exceeds the
    limit, but by no more than what is further off in another metric.
    """
    return max((_share(name, values[name], limit) for name, limit in limits.items() if name in values), default=0.0)


def _share(name: str, value: float, limit: float) -> float:
    error, allowed = (1 - value, 1 - limit) if COMPARISON_METRICS[name].higher_is_better else (value, limit)
    if error <= 0:
        return 0.0
    return error / allowed if allowed > 0 else 1 + error / _UNIT_ERRORS[COMPARISON_METRICS[name].unit]


def _signed_errors_in_255ths(golden: Pixels, actual: Pixels) -> npt.NDArray[np.int32]:
    """Return actual minus golden, [h, w, 3 or 4], in 255ths of a level, which are exact."""
    errors = actual.astype(np.int32) - golden
    if golden.shape[2] == 4:
        errors[..., :3] *= np.maximum(golden[..., 3:], actual[..., 3:])
        errors[..., 3] *= _UNITS_PER_LEVEL
    else:
        errors *= _UNITS_PER_LEVEL
    return errors


def _largest_window_sum(errors: npt.NDArray[np.int32]) -> int:
    """Return the largest sum of errors [h, w] >= 0 in a square of WINDOW_PX pixels, or what fits of it."""
    return int(_sums_down(_sums_down(errors).T).max())


def _sums_down(values: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """Return the sums over every WINDOW_PX rows, or over all rows of fewer. Sums of both axes stay below 2^23."""
    num = min(WINDOW_PX, len(values))
    sums: npt.NDArray[np.int32] = values[: len(values) - num + 1].copy()
    for first in range(1, num):
        sums += values[first : first + len(sums)]
    return sums


def _blocks(height: int, width: int) -> Iterator[tuple[_Block, _Block]]:
    """Yield the squares of a picture, each with a margin of REACH_PX, and the square's place in it."""
    for top in range(0, height, _BLOCK_PX):
        for left in range(0, width, _BLOCK_PX):
            y, x = max(top - REACH_PX, 0), max(left - REACH_PX, 0)
            around = slice(y, top + _BLOCK_PX + REACH_PX), slice(x, left + _BLOCK_PX + REACH_PX)
            yield around, (slice(top - y, top - y + _BLOCK_PX), slice(left - x, left - x + _BLOCK_PX))


def _over(image: Pixels, ground: float) -> npt.NDArray[Any]:
    """Composite over a grey level; return float64 [h, w, 3] in [0, 1]."""
    values = image / 255
    if image.shape[2] == 3:
        return values
    alpha = values[..., 3:]
    return np.clip(values[..., :3] * alpha + (1 - alpha) * ground, 0, 1)
