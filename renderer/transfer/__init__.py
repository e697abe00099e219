"""Scalars to colours and extinctions.

In: control points or a colormap. Out: `TransferFunction`; `Classifier`, which compiled loops classify voxels by; the
table that bricks are drawn by; the min-max test for empty-space skipping; Lambert's law.
Emission and absorption by Max 1995: tau = -log1p(-opacity) / unit.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
