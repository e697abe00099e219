"""Scalars to colours and extinctions.

In: control points or a colormap. Out: `TransferFunction`; `Classifier`, which kernels classify voxels by; the
table that bricks are drawn by; the min-max test for empty-space skipping; Lambert's law.
Emission and absorption by Max 1995: tau = -log1p(-opacity) / unit, where `unit` is the length that opacities are for.

- `transfer_function.py`: control points to extinctions, exactly; the min-max test, whether anything between two scalars
  shows; `piecewise.py`: tables of linear pieces.
- `light_factors.py`: the type of the light grid, whose factors `renderer.lighting` computes.
- `classify.py`: the tables by which voxels get colours and extinctions, and the light on them.

A transfer function has four forms here. `TransferFunction` has the control points of the scene, in its units.
`TransferTable`, float64, is what kernels evaluate scalars of 32 bits and more by, and measure sub-voxel
variation against. `Classifier.table` has the channels of each of the 2^16 bit patterns of narrower voxels: a look-up is
faster. `PiecewiseTransfer`, float32, is `TransferTable` over the scalars of texels, in the layout that rasterisers
read. The truth has a form of its own (`Intervals` in `renderer/truth/`), because it checks these.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
