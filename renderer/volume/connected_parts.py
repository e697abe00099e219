"""Find the connected parts of a set of cells in a grid, and grow such a set."""

from __future__ import annotations

import numpy as np

from renderer.volume.arrays import Bools, Int64


def label_parts(cells: Bools) -> Int64:
    """Return the number of the connected part that each cell belongs to, int64 [z, y, x]; -1 for cells in no part.

    Neighbours along an axis are connected. The number of a part is the lowest flat index of its cells. cells: which
    cells belong to parts, [z, y, x].
    """
    places = np.arange(cells.size).reshape(cells.shape)
    begins = cells.copy()
    begins[..., 1:] &= ~cells[..., :-1]
    runs = np.maximum.accumulate(np.where(begins, places, 0), axis=2)  # the first cell of each run along x
    pairs = [np.empty((2, 0), np.int64)]
    for axis in range(2):
        run, are_in, begin = (np.moveaxis(each, axis, 0) for each in (runs, cells, begins))
        meet = are_in[:-1] & are_in[1:] & (begin[:-1] | begin[1:])
        pairs.append(np.array([run[:-1][meet], run[1:][meet]]))
    labels, joined = np.where(cells, runs, places).ravel(), np.concatenate(pairs, axis=1)
    while joined.size:
        low, high = np.sort(labels[joined], axis=0)
        np.minimum.at(labels, high, low)
        while not np.array_equal(labels, jumped := labels[labels]):
            labels = jumped
        joined = joined[:, labels[joined[0]] != labels[joined[1]]]
    return np.where(cells, labels.reshape(cells.shape), -1)


def grow(cells: Bools, distance: int) -> Bools:
    """Return a set of cells with all cells that lie within `distance` cells of it along each axis: bool [z, y, x].

    cells: which cells belong to the set, [z, y, x].
    """
    grown = np.pad(cells, distance)
    for axis in range(3):
        grown = np.asarray(np.lib.stride_tricks.sliding_window_view(grown, 2 * distance + 1, axis).any(axis=-1))
    return grown
