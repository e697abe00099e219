"""How much of the light reaches each place: factors on a grid of cells, and how they are interpolated.

`renderer.lighting` computes them. A grid has the outermost cells once more beyond each border, so that the nearest ones
hold there. Places in it are in cells: the centre of cell i is at i + 1 along each axis, and the volume begins at 1/2.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels import LightGrid
from renderer.volume import Float32

_NO_FACTORS = np.empty((0, 0, 0), np.float32)
NO_LIGHT_GRID = LightGrid(_NO_FACTORS, _NO_FACTORS, np.empty(0, np.int32), 1.0, 0.0, 0.0)


def make_light_grid(
    occlusion: Float32 | None, shadow: Float32 | None, cell_size: float, strengths: tuple[float, float]
) -> LightGrid:
    """Return the grid of factors, float32 [z + 2, y + 2, x + 2], or None; they are rounded."""
    grids, packed = [_NO_FACTORS, _NO_FACTORS], []
    for number, factors in enumerate((occlusion, shadow)):
        if factors is not None:
            steps = np.rint(factors * np.float32(255)).astype(np.uint8)
            grids[number] = steps / np.float32(255)
            beyond, (z, y, x) = np.pad(steps, (0, 1), mode="edge"), steps.shape
            packed += [beyond[k : k + z, j : j + y, i : i + x] for k, j, i in np.ndindex(2, 2, 2)]
    if not packed:
        return NO_LIGHT_GRID
    corners = np.append(np.stack(packed, axis=-1).reshape(-1), np.zeros(8, np.uint8)).view(np.int32)
    strengths = strengths[0] * (occlusion is not None), strengths[1] * (shadow is not None)
    return LightGrid(grids[0], grids[1], corners, cell_size, *strengths)
