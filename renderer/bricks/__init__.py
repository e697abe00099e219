"""Divide a volume into bricks of 16^3 cells, which the default footprint, `integrated`, draws.

In: `Volume`, `TransferFunction`. Out: `Bricks` of every level, with their pyramid; `BrickCut`, the bricks drawn at a
tolerance; `BrickBatch`, the cut with a step length for each brick; texels of bricks. The field is interpolated inside a
brick and integrated along each ray (Max 1995).

- `bricks.py`: bricks of all levels, built from voxels and nodes
- `subvoxel.py`: a table of channels by scalar, with which the sub-voxel variation of level 0 is measured
- `node_statistics.py`: errors, bounds and step error estimates of higher levels, from the nodes of the pyramid
- `brick_layers.py`: the bricks of layers on one grid of voxels, joined
- `brick_cut.py`: the bricks drawn at a tolerance, and their number
- `sampling.py`: step lengths, samples and jitter
- `pixel_grid.py`: the pixels that are drawn, the strides of subsampled grids, and the ends of rays
- `extremes.py`: bricks in which rays look for the most extreme scalar
- `texels.py`: the values that are interpolated in a brick and its halo
- `brick_means.py`: means of nodes in a brick, gathered or recomputed when they are drawn
- `layout.py`: the places of cells in a brick, and the voxels that kernels read
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
