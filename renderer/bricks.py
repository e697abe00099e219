"""Bricks: cubes of BRICK^3 cells of one level of the pyramid, what the integrated footprint cuts and draws.

A brick of level l is a node of level l + BRICK_LEVELS of the octree, filled with the nodes of level l in it; one of
level 0 is filled with voxels. Between the centres of its cells the field is linear, as it is between those of this
brick and those of its neighbours at the same level, whatever is drawn there: the apron.

    level 0     the scalar, classified after it is interpolated
    above       the means of (tau c, tau), which may be interpolated for they were classified before
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.pyramid import Pyramid
from renderer.transfer import TransferFunction
from renderer.volume import Volume

Float64 = npt.NDArray[np.float64]
Int32 = npt.NDArray[np.int32]

BRICK_LEVELS = 4
BRICK = 1 << BRICK_LEVELS  # cells along each side
APRON = 1  # cells of the neighbours on each side that interpolation needs


@dataclass(frozen=True)
class BrickLevel:
    """All bricks of one level, those that show nothing, too.

    boxes: float32 [z, y, x, 2, 3], lowest and highest corner (x, y, z), in cells from the brick's own lowest corner
        (0 to BRICK), of what may be seen in the brick: where the field, its apron included, is not transparent. Corners
        lie at cells' centres (k + 1/2) or at the brick's faces or the volume's. The highest is not above the lowest
        where nothing is.
    largest_errors: float64 [z, y, x], of the nodes of this level in the brick, in the measure's unit; 0 on level 0.
    roughness: float64 [z, y, x], root of the mean square over the brick's volume of the errors of the nodes one level
        *above*: what cells twice as large would put wrong. 0 where there is no level above.
    slots: int32 [z, y, x], place of the brick in `means`, -1 where all of them are 0; empty on level 0.
    means: float16 or float32 [n, BRICK, BRICK, BRICK, 4], cells in the order (z, y, x), stored units; empty on level 0.
    """

    boxes: npt.NDArray[np.float32]
    largest_errors: Float64
    roughness: Float64
    slots: Int32
    means: npt.NDArray[np.float16] | npt.NDArray[np.float32]


@dataclass(frozen=True)
class Bricks:
    """levels[l] holds the bricks of level l; the last one is a single brick.

    scalar_range: what texels of level 0 are relative to: scalars at the ends of the transfer function's table.
    """

    levels: tuple[BrickLevel, ...]
    pyramid: Pyramid
    transfer: TransferFunction
    scalar_range: tuple[float, float]

    @property
    def volume(self) -> Volume:
        """What the bricks are of."""
        return self.pyramid.volume


@dataclass(frozen=True)
class BrickCut:
    """The bricks drawn, coarse levels first, in Morton order within a level: a brick's place is its id.

    levels: uint8 [n], of their cells. cells: int32 [n, 3], x, y, z in units of the brick's own width, BRICK << level
        voxels.
    boxes: float64 [n, 2, 3], lowest and highest corner (x, y, z) of what may be seen, in index coordinates.
    roughness: float64 [n], as in BrickLevel.
    volume: the volume that was cut.
    """

    levels: npt.NDArray[np.uint8]
    cells: Int32
    boxes: Float64
    roughness: Float64
    volume: Volume

    def __len__(self) -> int:
        return len(self.levels)
