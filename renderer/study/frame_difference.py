"""How far one picture of 8 bits is from another, in the figures by which a golden frame passes or fails.

Most of them are in levels, of which a channel has 255. Where a picture has alpha, a colour counts as much as it is
opaque, in the one of both pictures in which it is more so, and alpha is a channel beside the colours. Premultiplied
colours would count a change of alpha twice: where rounding moves a colour and its alpha by one level each, they move by
up to two.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.study.metrics import REACH_PX, SSIM_WINDOW_PX, Metric, metric_map

Pixels = npt.NDArray[np.uint8]
Levels = npt.NDArray[np.float32]

WINDOW_PX = 8

_PARTS = 255  # of a level: a difference of one level at an opacity of one
# A picture is looked at as it is seen in squares of so many pixels: all of a large one would take gigabytes.
_BLOCK_PX = 256

_Block = tuple[slice, slice]


# In the order in which they are looked at: the first one over its limit is the reason that is given.
COMPARISON_METRICS = {
    figure.name: figure
    for figure in (
        Metric("largest", "largest error of a channel", "levels"),
        Metric("p99", "99th percentile of the pixels' largest errors", "levels"),
        Metric("flip", "mean FLIP", ""),
        Metric("ssim", "mean SSIM", "", higher_is_better=True),
        Metric(
            "densest", f"mean error of a channel in the densest window of {WINDOW_PX} x {WINDOW_PX} pixels", "levels"
        ),
        Metric("bias", "mean signed error of the most shifted channel", "levels"),
    )
}


class FrameDifference:
    """A picture, `actual`, against another of the same shape, uint8 [h, w, 3] or, with straight alpha, [h, w, 4]."""

    def __init__(self, golden: Pixels, actual: Pixels) -> None:
        assert golden.shape == actual.shape and golden.dtype == actual.dtype == np.uint8, (golden.shape, actual.shape)
        self._golden, self._actual = golden, actual
        self._parts = _signed_errors_in_255ths(golden, actual)

    @property
    def signed(self) -> Levels:
        """float32 [h, w, 3 or 4]: actual minus golden, in levels."""
        return _in_levels(self._parts)

    @property
    def signed_levels(self) -> Levels:
        """float32 [h, w]: of each pixel's channels the one that is off most, with its sign."""
        largest = np.abs(self._parts).argmax(axis=2)[..., None]
        return _in_levels(np.take_along_axis(self._parts, largest, axis=2)[..., 0])

    @property
    def levels(self) -> Levels:
        """float32 [h, w]: the same without its sign."""
        return np.abs(self.signed_levels)

    @property
    def bias(self) -> tuple[float, ...]:
        """Mean signed error of each channel, actual minus golden, in levels."""
        return tuple((self._parts.mean(axis=(0, 1)) / _PARTS).tolist())

    def metrics(self, names: Iterable[str]) -> dict[str, float]:
        """Compute these of COMPARISON_METRICS, in their order; without SSIM for a picture smaller than its window.

        FLIP needs the package flip-evaluator, SSIM scikit-image.
        """
        wanted = set(names)
        assert wanted <= set(COMPARISON_METRICS), wanted
        found = {name: figure(self) for name, figure in _COMPARISON_FUNCTIONS.items() if name in wanted}
        return {name: value for name, value in found.items() if not math.isnan(value)}

    def largest(self) -> float:
        """In levels, over all pixels and channels."""
        return max(int(self._parts.max()), -int(self._parts.min())) / _PARTS

    def p99(self) -> float:
        """Of the pixels' `levels`."""
        return float(np.percentile(np.abs(self._parts).max(axis=2), 99)) / _PARTS

    def densest(self) -> float:
        """The largest mean error of a channel in a square of WINDOW_PX pixels, or what fits of it.

        That is what many small errors add up to where they are close together.
        """
        sums = [_largest_window_sum(np.abs(self._parts[..., channel])) for channel in range(self._parts.shape[2])]
        height, width = (min(WINDOW_PX, length) for length in self._parts.shape[:2])
        return float(max(sums) / (_PARTS * height * width))

    def perceived(self, name: str) -> float:
        """SSIM or FLIP of the pictures as they are seen; transparent ones over the worse of black and white."""
        height, width, channels = self._golden.shape
        if name == "ssim" and min(height, width) < SSIM_WINDOW_PX:
            return math.nan
        perfect = float(COMPARISON_METRICS[name].higher_is_better)
        errors = [0.0] if channels == 3 else [0.0, 0.0]  # over black, over white
        for around, cut in _blocks(height, width):
            if self._parts[around].any():
                for ground in range(len(errors)):
                    actual, golden = _over(self._actual[around], ground), _over(self._golden[around], ground)
                    errors[ground] += float(np.sum(np.abs(metric_map(name, actual, golden)[cut] - perfect)))
        return float(abs(perfect - max(errors) / (height * width)))


def _largest_bias(difference: FrameDifference) -> float:
    return max(map(abs, difference.bias))


_COMPARISON_FUNCTIONS: dict[str, Callable[[FrameDifference], float]] = {
    "largest": FrameDifference.largest,
    "p99": FrameDifference.p99,
    "flip": lambda difference: difference.perceived("flip"),
    "ssim": lambda difference: difference.perceived("ssim"),
    "densest": FrameDifference.densest,
    "bias": _largest_bias,
}


def _signed_errors_in_255ths(golden: Pixels, actual: Pixels) -> npt.NDArray[np.int32]:
    """[h, w, 3 or 4]: actual minus golden in 255ths of a level, which are exact."""
    parts = actual.astype(np.int32) - golden
    if golden.shape[2] == 4:
        parts[..., :3] *= np.maximum(golden[..., 3:], actual[..., 3:])
        parts[..., 3] *= _PARTS
    else:
        parts *= _PARTS
    return parts


def _in_levels(parts: npt.NDArray[np.int32]) -> Levels:
    levels: Levels = parts.astype(np.float32)
    levels /= _PARTS
    return levels


def _largest_window_sum(errors: npt.NDArray[np.int32]) -> int:
    """Of [h, w] >= 0, over all squares of WINDOW_PX pixels, or what fits of one."""
    return int(_sums_down(_sums_down(errors).T).max())


def _sums_down(values: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """Of every WINDOW_PX rows, or all of fewer. Those of columns, too, stay below 2^23."""
    num = min(WINDOW_PX, len(values))
    sums: npt.NDArray[np.int32] = values[: len(values) - num + 1].copy()
    for first in range(1, num):
        sums += values[first : first + len(sums)]
    return sums


def _blocks(height: int, width: int) -> Iterator[tuple[_Block, _Block]]:
    """Squares of a picture with all that is within reach of them, and where they are therein."""
    for top in range(0, height, _BLOCK_PX):
        for left in range(0, width, _BLOCK_PX):
            rows, columns = _with_halo(top, height), _with_halo(left, width)
            y, x = top - rows.start, left - columns.start
            yield (rows, columns), (slice(y, y + _BLOCK_PX), slice(x, x + _BLOCK_PX))


def _with_halo(start: int, length: int) -> slice:
    return slice(max(start - REACH_PX, 0), min(start + _BLOCK_PX + REACH_PX, length))


def _over(image: Pixels, ground: float) -> npt.NDArray[Any]:
    """float64 [h, w, 3] in [0, 1]."""
    values = image / 255
    if image.shape[2] == 3:
        return values
    alpha = values[..., 3:]
    return np.clip(values[..., :3] * alpha + (1 - alpha) * ground, 0, 1)
