"""Compares a picture of 8 bits with its golden frame, by several metrics.

Most metrics are in grey steps; a channel has 255 of them. If the pictures have alpha, alpha is a channel beside the
colours, and the error of a colour is weighted by the larger of both opacities. Premultiplied colours would count a
change of alpha twice: if a colour and its alpha each differ by one step of rounding, they would differ by two steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from renderer.accuracy import REACH_PX, SSIM_WINDOW_PX, Metric, metric_map
from renderer.film import Pixels
from renderer.volume import Array, Float32, Int32

# Side of the windows of the metric `densest`, in pixels.
WINDOW_PX = 8

# Number of units of error in one grey step at an opacity of 1. In this unit, 1/255 of a grey step, errors that are
# weighted by 8-bit opacities are whole numbers.
_UNITS_PER_STEP = 255
# Side of the squares in which perceptual metrics are computed, in pixels: a large picture would take gigabytes at once.
_BLOCK_PX = 256

_Block = tuple[slice, slice]


class FrameDifference:
    """Measures the difference of a picture, `actual`, from its golden, a picture of the same shape.

    Both are uint8 [h, w, 3] or, with straight alpha, [h, w, 4].
    """

    def __init__(self, golden: Pixels, actual: Pixels) -> None:
        assert golden.shape == actual.shape and golden.dtype == actual.dtype == np.uint8, (golden.shape, actual.shape)
        self._golden, self._actual = golden, actual
        self._signed_errors = _signed_errors_in_255ths(golden, actual)

    @property
    def signed_steps(self) -> Float32:
        """Return float32 [h, w]: each pixel's error in its worst channel, actual minus golden, in grey steps."""
        largest = np.abs(self._signed_errors).argmax(axis=2)[..., None]
        steps = np.take_along_axis(self._signed_errors, largest, axis=2)[..., 0].astype(np.float32)
        steps /= _UNITS_PER_STEP
        return steps

    @property
    def bias(self) -> tuple[float, ...]:
        """Return the mean signed error of each channel, actual minus golden, in grey steps."""
        return tuple((self._signed_errors.mean(axis=(0, 1)) / _UNITS_PER_STEP).tolist())

    def metrics(self, names: Iterable[str]) -> dict[str, float]:
        """Compute the named metrics, in the order of COMPARISON_METRICS; SSIM only if its window fits.

        FLIP needs the package flip-evaluator, SSIM scikit-image.
        """
        wanted = set(names)
        assert wanted <= set(COMPARISON_METRICS), wanted
        found = {metric.name: of(self) for metric, of in _FUNCTIONS.items() if metric.name in wanted}
        return {name: value for name, value in found.items() if not math.isnan(value)}

    def largest(self) -> float:
        """Return the largest error over all pixels and channels, in grey steps."""
        return max(int(self._signed_errors.max()), -int(self._signed_errors.min())) / _UNITS_PER_STEP

    def p99(self) -> float:
        """Return the 99th percentile of the error of each pixel's worst channel, in grey steps."""
        return float(np.percentile(np.abs(self._signed_errors).max(axis=2), 99)) / _UNITS_PER_STEP

    def densest(self) -> float:
        """Return the largest mean error of a channel in a square window of WINDOW_PX pixels, cut to a smaller picture.

        It detects many small errors that are close together.
        """
        errors = np.abs(self._signed_errors)
        sums = [int(_sums_down(_sums_down(errors[..., channel]).T).max()) for channel in range(errors.shape[2])]
        height, width = (min(WINDOW_PX, length) for length in errors.shape[:2])
        return float(max(sums) / (_UNITS_PER_STEP * height * width))

    def perceptual_metric(self, name: str) -> float:
        """Return SSIM or FLIP of the pictures; for transparent pictures, the worse value over black and over white.

        Returns NaN where a picture is smaller than the window of SSIM.
        """
        height, width, channels = self._golden.shape
        if name == "ssim" and min(height, width) < SSIM_WINDOW_PX:
            return math.nan
        perfect = float(COMPARISON_METRICS[name].higher_is_better)
        errors = [0.0] if channels == 3 else [0.0, 0.0]  # sums of errors over black, and with alpha also over white
        for around, cut in _blocks(height, width):
            if self._signed_errors[around].any():
                for ground in range(len(errors)):
                    actual, golden = _over(self._actual[around], ground), _over(self._golden[around], ground)
                    errors[ground] += float(np.sum(np.abs(metric_map(name, actual, golden)[cut] - perfect)))
        return float(abs(perfect - max(errors) / (height * width)))


# The metrics in the order in which they are checked: the first that exceeds its limit is the reason of a failure.
_FUNCTIONS: dict[Metric, Callable[[FrameDifference], float]] = {
    Metric("largest", "largest error of a channel", "steps"): FrameDifference.largest,
    Metric("p99", "99th percentile of the pixels' largest errors", "steps"): FrameDifference.p99,
    Metric("flip", "mean FLIP"): lambda difference: difference.perceptual_metric("flip"),
    Metric("ssim", "mean SSIM", higher_is_better=True): lambda difference: difference.perceptual_metric("ssim"),
    Metric(
        "densest", f"mean error of a channel in the densest window of {WINDOW_PX} x {WINDOW_PX} pixels", "steps"
    ): FrameDifference.densest,
    Metric("bias", "mean signed error of the most shifted channel", "steps"): (
        lambda difference: max(map(abs, difference.bias))
    ),
}
COMPARISON_METRICS = {metric.name: metric for metric in _FUNCTIONS}


def _signed_errors_in_255ths(golden: Pixels, actual: Pixels) -> Int32:
    """Return actual minus golden, [h, w, 3 or 4], in 255ths of a grey step.

    Errors of colours are multiplied by the larger alpha of both pictures, from 0 to 255, so that they stay whole
    numbers.
    """
    errors: Int32 = actual.astype(np.int32) - golden
    if golden.shape[2] == 4:
        errors[..., :3] *= np.maximum(golden[..., 3:], actual[..., 3:])
        errors[..., 3] *= _UNITS_PER_STEP
    else:
        errors *= _UNITS_PER_STEP
    return errors


def _sums_down(values: Int32) -> Int32:
    """Return the sums of each column over WINDOW_PX consecutive rows, or over all rows if there are fewer.

    A sum of one channel over a window, down and then across, stays below 2^23, within int32.
    """
    num = min(WINDOW_PX, len(values))
    sums: Int32 = values[: len(values) - num + 1].copy()
    for first in range(1, num):
        sums += values[first : first + len(sums)]
    return sums


def _blocks(height: int, width: int) -> Iterator[tuple[_Block, _Block]]:
    """Yield the squares of a picture, each with a margin of REACH_PX, and the place of the square within its margin."""
    for top in range(0, height, _BLOCK_PX):
        for left in range(0, width, _BLOCK_PX):
            y, x = max(top - REACH_PX, 0), max(left - REACH_PX, 0)
            around = slice(y, top + _BLOCK_PX + REACH_PX), slice(x, left + _BLOCK_PX + REACH_PX)
            yield around, (slice(top - y, top - y + _BLOCK_PX), slice(left - x, left - x + _BLOCK_PX))


def _over(image: Pixels, ground: float) -> Array:
    """Composite a picture over a grey, from 0 for black to 1 for white; return float64 [h, w, 3] in [0, 1]."""
    values = image / 255
    if image.shape[2] == 3:
        return values
    alpha = values[..., 3:]
    return np.clip(values[..., :3] * alpha + (1 - alpha) * ground, 0, 1)
