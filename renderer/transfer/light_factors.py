"""Make the light grid: the share of the light that reaches each place, at the centres of cells of a grid.

`renderer.lighting` computes the shares, called factors. A grid repeats the outermost cells once beyond each border, so
that factors are constant there. Places in a grid are measured in cells: the centre of cell i is at i + 1 along each
axis, and the volume begins at 1/2.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels import LightGrid
from renderer.volume import Float32

# An empty grid of factors, for a scene without occlusion or without shadow.
_NO_FACTORS = np.empty((0, 0, 0), np.float32)
# The light grid of a scene in which all light reaches every place.
NO_LIGHT_GRID = LightGrid(_NO_FACTORS, _NO_FACTORS, np.empty(0, np.int32), 1.0, 0.0, 0.0)


def make_light_grid(
    occlusion: Float32 | None, shadow: Float32 | None, cell_size: float, strengths: tuple[float, float]
) -> LightGrid:
    """Return the light grid of some factors, which are rounded to multiples of 1/255.

    occlusion, shadow: the share of ambient light, and of the scene's light, that reaches each cell, from 0 to 1,
    float32 [z + 2, y + 2, x + 2]; None without the effect. cell_size: the size of a cell. strengths: the weights of
    occlusion and of shadow.
    """
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
