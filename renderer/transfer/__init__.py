"""Scalars to colours and extinctions.

In: control points or a colormap. Out: `TransferFunction`; `Classifier`, which compiled loops classify voxels by; the
table that bricks are drawn by; the min-max test for empty-space skipping; Lambert's law.
Emission and absorption by Max 1995: tau = -log1p(-opacity) / unit, where `unit` is the length that opacities are for.

- `transfer_function.py`: control points to extinctions, exactly; the min-max test, whether anything between two scalars
  shows; `piecewise.py`: the one table of linear pieces.
- `classify.py`: one voxel to colour and extinction, compiled, with Lambert's law on the gradient.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
