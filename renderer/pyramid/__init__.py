"""Build the pyramid of averages and errors, and cut its octree at a tolerance.

In: `Volume`, `TransferFunction`. Out: `Pyramid`, whose nodes of level l are averages over cells, cubes of 2^l voxels;
`Cut`, the coarsest nodes whose error is below a tolerance (Laur and Hanrahan 1991); `CutSizes`, from which a budget of
cells finds its tolerance. Means and variances of children are merged as in Chan, Golub and LeVeque 1979.

- `pyramid.py`: the pyramid and its levels
- `building.py`: the pyramid, built level by level, without macrocells (blocks of voxels) in which nothing is visible
- `nodes.py`: arrays for the nodes that kernels build, and their storage
- `cut.py`: the nodes drawn at a tolerance
- `cut_size.py`: the number of cells at any tolerance, for a budget of cells
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
