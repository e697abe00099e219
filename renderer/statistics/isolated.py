"""Find voxels with values far from their neighbours and beyond the range of all others, such as hot and dead pixels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from renderer.volume import Array, Bools, Int64, MappedFile, map_slabs

# At most this share of all voxels may be outliers at each end of the range. A larger share is no noise.
MAX_FRACTION = 1e-3
# The highest values of a volume, or the lowest, are outliers only if at least this share of the voxels with such values
# are isolated. The share is less than 1 because, of many hot or dead pixels, some touch.
_MIN_ISOLATED = 0.95
# A voxel is isolated if its value is farther than this from the range of its neighbours' values, in widths of this
# range. Noise reaches 0.7. Among the lowest and the highest percent of the voxels of 40 volumes, 7 voxels reach 2;
# other voxels have values as low or as high as theirs.
_MIN_DISTANCE = 2.0
# Voxels of a volume in which a voxel has fewer neighbours than this are never isolated: neighbours along a single line
# are too few to tell.
_MIN_NEIGHBOURS = 8


@dataclass(frozen=True)
class OutlierValue:
    """A range of values, `value` to `last`, that `num` isolated voxels have, beyond the range of all other values."""

    value: int | float
    num: int
    last: int | float


# The outliers of a volume, and the lowest and the highest of all other values.
OutlierSplit = tuple[tuple[OutlierValue, ...], float, float]


def find_isolated(
    values: Array, source: MappedFile | None, ends: tuple[float, float, float, float], scale: float
) -> OutlierSplit | None:
    """Return the values of isolated voxels, and the range of all other values; None if no voxel is isolated.

    values: C-contiguous. source: the file that the values are mapped from, if any. ends: the minimum, the lowest and
    the highest usual value, and the maximum; only voxels below or above the usual values may be isolated, at most the
    share MAX_FRACTION at each end. scale: a power of two by which values are multiplied, so that differences stay
    finite.
    """
    minimum, *usual, maximum = ends
    cube = values.reshape(-1, *(1, 1, *values.shape)[-2:])

    def find(first: int, slab: Array) -> list[tuple[Array, Bools]]:
        """Return the values beyond each end of the usual ones, and whether their voxels are isolated."""
        are_beyond = (slab >= minimum) & (slab < usual[0]), (slab > usual[1]) & (slab <= maximum)
        places = [np.unravel_index(np.flatnonzero(each), slab.shape) for each in are_beyond]
        return [(slab[z, y, x], _are_isolated(cube, np.stack([z + first, y, x]), ends, scale)) for z, y, x in places]

    found = map_slabs(find, cube, source)
    outliers, others = list[OutlierValue](), usual
    for k in range(2):
        far, are_isolated = _sorted_inwards([slab[k] for slab in found], is_descending=k == 1)
        is_last = are_isolated & (np.cumsum(are_isolated) >= _MIN_ISOLATED * np.arange(1, len(far) + 1))
        num = int(np.flatnonzero(is_last).max(initial=-1)) + 1
        if num < len(far):
            others[k] = far[num].item()
        if num:
            outliers.append(OutlierValue(far[:num].min().item(), num, far[:num].max().item()))
    return (tuple(outliers), others[0], others[1]) if outliers and others[0] < others[1] else None


def _sorted_inwards(of_slabs: Sequence[tuple[Array, Bools]], *, is_descending: bool) -> tuple[Array, Bools]:
    """Return values, and whether their voxels are isolated, from the end of the range inwards.

    Among equal values, isolated voxels come last. of_slabs: the values of each slab, and whether they are isolated.
    """
    far, are_isolated = map(np.concatenate, zip(*of_slabs, strict=True))
    order = np.lexsort((are_isolated ^ is_descending, far))[:: -1 if is_descending else 1]
    return far[order], are_isolated[order]


def _are_isolated(cube: Array, places: Int64, ends: Sequence[float], scale: float) -> Bools:
    """Return which voxels have values far from all of their neighbours' values, or from all but one, bool [n].

    places: the indices of the voxels, [3, n].
    """
    if not places.size:
        return np.zeros(0, bool)
    steps = [step for step in product(*((-1, 0, 1) if num > 1 else (0,) for num in cube.shape)) if any(step)]
    if len(steps) < _MIN_NEIGHBOURS:
        return np.zeros(places.shape[1], bool)
    lasts = np.array(cube.shape)[:, None] - 1
    lowest, low, high, highest = np.repeat([[np.inf], [np.inf], [-np.inf], [-np.inf]], places.shape[1], axis=1)
    for step in steps:
        # A neighbour beyond the border is replaced by the voxel's neighbour on the opposite side.
        z, y, x = lasts - np.abs(lasts - np.abs(places + np.array(step)[:, None]))
        near = np.clip(cube[z, y, x] * scale, ends[0] * scale, ends[-1] * scale)
        # Neighbours without data, NaN, do not count.
        lowest, low = np.fmin(lowest, near), np.fmin(low, np.maximum(lowest, near))
        highest, high = np.fmax(highest, near), np.fmax(high, np.minimum(highest, near))
    own = cube[tuple(places)] * scale
    distance = np.maximum(own - high, low - own)
    return np.asarray((distance > 0) & (distance > _MIN_DISTANCE * (high - low)))
