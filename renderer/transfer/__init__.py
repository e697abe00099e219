"""Map scalars to colours and extinctions.

In: control points or a colormap. Out: `TransferFunction`; `Classifier`, with which kernels classify voxels; the table
by which bricks are drawn; the min-max test for empty-space skipping; Lambert's law.
Emission and absorption follow Max 1995: tau = -log1p(-opacity) / unit, where `unit` is the length to which opacities
refer.

- `transfer_function.py`: control points with exact extinctions, and the min-max test for a range of scalars
- `piecewise.py`: tables of linear pieces
- `albedos.py`: the albedos of matter from its colours
- `light_factors.py`: the type of the light grid, whose factors `renderer.lighting` computes
- `classify.py`: the tables by which voxels get colours, extinctions and light

A transfer function has four forms here. `TransferFunction` has the control points of the scene, in its units.
`TransferTable`, float64, serves kernels for scalars of 32 bits and more, and for sub-voxel variation.
`Classifier.table` has the channels of each of the 2^16 bit patterns of narrower voxels, because a look-up is faster.
`PiecewiseTransfer`, float32, is `TransferTable` over the scalars of texels, in the layout that rasterisers read. The
truth has a form of its own (`Intervals` in `renderer/truth/`), because it checks the other forms.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
