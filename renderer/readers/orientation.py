"""Turn and mirror pictures by the number of the field Orientation, which TIFF and EXIF have."""

from __future__ import annotations

import numpy as np

from renderer.volume import Float64

# The directions of a row and of a column of the stored pixels along those of the picture, right and down, by the number
# of Orientation: [right and down, row and column]. Of 6, the first row is the right side, and the first column the top.
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
    """Return the number of an orientation; 1, which neither turns nor mirrors, for all else."""
    return next((each for each in _TURNS if each == number), 1)


def oriented(world_from_index: Float64, orientation: int, size: tuple[int, int]) -> Float64:
    """Return the affine of a stack of pictures that are turned and mirrored; they begin at the same place.

    size: of the stored pixels, along x and y.
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
