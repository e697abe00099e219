"""The volume in bricks of 16^3 cells, for the integrated footprint.

In: `Volume`, `TransferFunction`. Out: `Bricks` of every level, with their pyramid; `BrickCut`, those drawn at a
tolerance; `BrickBatch`, the cut with a step length for each brick; their texels. The field is interpolated inside a
brick and integrated along each ray (Max 1995).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
