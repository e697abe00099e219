"""Sorted splats or bricks to a float image.

In: `SplatBatch` or `BrickBatch`, and an order. Out: float32 [height, width, 4], premultiplied. `GLRasterizer` draws
with OpenGL, the only room that does; `CPURasterizer` draws bricks in compiled loops.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
