"""Divide the tiles of a picture into bands whose bricks have slots at once, and say when each brick is used next."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from renderer.volume import Int64


class Band(NamedTuple):
    """A band of tiles that are drawn together.

    tiles: their numbers. met: int64 [n], the bricks over them, ascending. next_use: int64 [n], the number of the next
    band that meets each of these; bands of the next picture follow upon those of this one, and are taken to be alike.
    """

    tiles: Int64
    met: Int64
    next_use: Int64


def plan_bands(
    starts: Int64, numbers: Int64, num_bricks: int, have_slots: Callable[[Int64], bool]
) -> tuple[list[Band], Int64]:
    """Return bands of all tiles with bricks, and for each brick the first band that meets it, or -1: int64 [bricks].

    starts, numbers: the bricks over tiles, as `make_grid` returns them. have_slots: whether some bricks, ascending,
    have slots at once. A single tile is a band in any case.
    """
    bands, waiting = list[tuple[Int64, Int64]](), [np.flatnonzero(np.diff(starts))]
    while waiting:
        tiles = waiting.pop()
        is_met = np.zeros(num_bricks, np.bool_)
        for tile in tiles:
            is_met[numbers[starts[tile] : starts[tile + 1]]] = True
        met = np.flatnonzero(is_met)
        if tiles.size > 1 and not have_slots(met):
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
