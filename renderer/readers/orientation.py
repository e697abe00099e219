"""Turn and mirror pictures by the field Orientation of TIFF and EXIF."""

from __future__ import annotations

import numpy as np

from renderer.volume import Float64

# The directions of stored rows and columns in the picture, by the value of Orientation. The first pair is the component
# to the right of a row and of a column, and the second pair the component downwards. For value 6, the first stored row
# is the right side of the picture, and the first stored column is its top.
_TURNS = {
    1: ((1, 0), (0, 1)),
    2: ((-1, 0), (0, 1)),
    3: ((-1, 0), (0, -1)),
    4: ((1, 0), (0, -1)),
    5: ((0, 1), (1, 0)),
    6: ((0, -1), (1, 0)),
    7: ((0, -1), (-1, 0)),
    8: ((0, 1), (-1, 0)),
}


def known_orientation(number: object) -> int:
    """Return an orientation from 1 to 8; 1, which neither turns nor mirrors, for any other value."""
    return next((each for each in _TURNS if each == number), 1)


def oriented(world_from_index: Float64, orientation: int, size: tuple[int, int]) -> Float64:
    """Return the affine of a stack of pictures that the field Orientation turns or mirrors.

    world_from_index: the affine without turning. The upright pictures begin at the same corner. size: the numbers of
    stored pixels along x and y.
    """
    if orientation == 1 or not np.isfinite(world_from_index).all():
        return world_from_index
    turn = np.eye(3)
    turn[:2, :2] = _TURNS[orientation]
    spacing = np.linalg.norm(world_from_index[:3, :3], axis=0)
    made = world_from_index.copy()
    made[:3, :3] = world_from_index[:3, :3] / spacing @ turn * spacing
    for axis, num_pixels in enumerate(size):
        if turn[:, axis].min() < 0:
            made[:3, 3] -= made[:3, axis] * (num_pixels - 1)
    return np.asarray(made + 0.0, np.float64)
