"""Divide the tiles of a picture into bands whose bricks fit into the slots of the caches, and say when a brick is used
next."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from renderer.volume import Int64

# If the bricks of means or of colours of a picture do not all fit into the slots, those of a band take at most
# 1 / _BANDS_IN_SLOTS of them: a larger band would evict more bricks that could stay. A turntable of 15,168 bricks, with
# slots for 10,716, made 10,500 bricks anew for each frame with 1, 6900 to 7200 with 4, 6850 with 8, and 6850 with 64.
# With slots for 5487 bricks, it made 14,600, 12,800, 12,600 and 12,600.
_BANDS_IN_SLOTS = 8


class Band(NamedTuple):
    """A band of tiles that are drawn together.

    tiles: the numbers of the tiles.
    met: int64 [n], the numbers of the bricks over the tiles, ascending.
    next_use: int64 [n], the number of the next band that meets each of these bricks. The next picture is assumed to
        have the same bands, whose numbers go on from the last band of this picture.
    """

    tiles: Int64
    met: Int64
    next_use: Int64


def plan_bands(
    starts: Int64, numbers: Int64, num_bricks: int, have_slots: Callable[[Int64, int], bool]
) -> tuple[list[Band], Int64]:
    """Return bands of all tiles with bricks, and the first band that meets each brick, or -1: int64 [bricks].

    starts, numbers: the bricks over tiles, as `make_grid` returns them. have_slots: takes the ascending numbers of
    some bricks and a factor, and says whether there are slots for this factor times as many bricks. A band has at least
    one tile, even if its bricks do not fit.
    """
    bands, waiting, is_divided = list[tuple[Int64, Int64]](), [np.flatnonzero(np.diff(starts))], False
    while waiting:
        tiles = waiting.pop()
        is_met = np.zeros(num_bricks, np.bool_)
        if tiles.size:  # tiles between the first and the last that are not among them have no bricks
            is_met[numbers[starts[tiles[0]] : starts[tiles[-1] + 1]]] = True
        met = np.flatnonzero(is_met)
        times = _BANDS_IN_SLOTS if is_divided else 1
        if tiles.size > 1 and not have_slots(met, times):
            is_divided = True
            waiting += reversed(np.array_split(tiles, 2))
        else:
            bands.append((tiles, met))
    first_use = np.full(num_bricks, -1, np.int64)
    following = list[Int64]()
    for band in reversed(range(len(bands))):
        met = bands[band][1]
        following.append(first_use[met])
        first_use[met] = band
    found = [
        Band(tiles, met, np.where(again < 0, len(bands) + first_use[met], again))
        for (tiles, met), again in zip(bands, reversed(following), strict=True)
    ]
    return found, first_use
