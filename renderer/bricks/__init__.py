"""The volume in bricks of 16^3 cells, for the integrated footprint.

In: `Volume` and `Pyramid`. Out: `Bricks`, their errors and texels; `BrickBatch`, the cut with a step length for each
brick. The field is interpolated inside a brick and integrated along each ray (Max 1995).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
