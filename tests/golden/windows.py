"""Candidates for the figure `densest`, of which one was chosen."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]


def _means(values: Float64, side: int) -> Float64:
    """[..., c]: means of a picture [h, w, c] in all squares with sides of `side` pixels."""
    height, width = (min(side, length) for length in values.shape[:2])
    sums = np.pad(values.cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0), (0, 0)))
    windows = sums[height:, width:] - sums[:-height, width:] - sums[height:, :-width] + sums[:-height, :-width]
    return np.asarray(windows / (height * width))


def _size(side: int) -> Callable[[Float64], float]:
    return lambda signed: float(_means(np.abs(signed), side).mean(axis=2).max())


def _worst_channel(side: int) -> Callable[[Float64], float]:
    return lambda signed: float(_means(np.abs(signed), side).max())


def _signed(side: int) -> Callable[[Float64], float]:
    return lambda signed: float(np.abs(_means(signed, side)).max())


def _share(side: int, levels: float) -> Callable[[Float64], float]:
    def share(signed: Float64) -> float:
        return float(_means((np.abs(signed).max(axis=2, keepdims=True) > levels).astype(np.float64), side).max())

    return share


def _root_mean_square(side: int) -> Callable[[Float64], float]:
    return lambda signed: float(np.sqrt(_means(signed**2, side).mean(axis=2).max()))


# By name; each is given actual minus golden in levels, float64 [h, w, c].
WINDOWS: Mapping[str, Callable[[Float64], float]] = {
    "mean error, 4 px": _size(4),
    "mean error, 8 px": _size(8),
    "mean error, 16 px": _size(16),
    "mean error of the worst channel, 8 px": _worst_channel(8),
    "mean error of the worst channel, 16 px": _worst_channel(16),
    "mean signed error of the worst channel, 8 px": _signed(8),
    "mean signed error of the worst channel, 16 px": _signed(16),
    "mean signed error of the worst channel, 32 px": _signed(32),
    "root mean square error, 8 px": _root_mean_square(8),
    "share of pixels that differ, 8 px": _share(8, 0),
    "share of pixels off by more than 1 level, 8 px": _share(8, 1),
}
