"""The volume in bricks of 16^3 cells, which the default footprint, `integrated`, draws.

In: `Volume`, `TransferFunction`. Out: `Bricks` of every level, with their pyramid; `BrickCut`, those drawn at a
tolerance; `BrickBatch`, the cut with a step length for each brick; their texels. The field is interpolated inside a
brick and integrated along each ray (Max 1995).

- `bricks.py`: builds all levels; `subvoxel.py`: of what the sub-voxel variation of the finest level is measured, whose
  cells are voxels; `node_statistics.py`: errors, bounds and step error estimates of the others, whose cells are nodes.
- `brick_layers.py`: the bricks of layers on one grid of voxels as one; `brick_cut.py`: which bricks are drawn at a
  tolerance; `sampling.py`: step lengths, samples and jitter; `pixel_grid.py`: which pixels are drawn, the strides of
  subsampled grids, and where rays end; `extremes.py`: bounds of the scalars in bricks.
- `texels.py`: what is interpolated in a brick and its halo; `brick_means.py`: means, gathered or recomputed when they
  are drawn; `layout.py`: where cells lie in a brick, and the voxels that kernels read.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
