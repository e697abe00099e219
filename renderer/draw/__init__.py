"""Sorted splats or bricks to a float image.

In: `SplatBatch` or `BrickBatch`, the order of its elements, and a `View`. Out: float32 [height, width, 4],
premultiplied RGBA without a background. Each footprint has its rasteriser.

- `rasterizer.py` says what they have in common; `open_rasterizer.py` opens the one of a scene.
- `gl/splat_rasterizer.py` draws splats with OpenGL, and only splats need it. `gl/shaders/project.glsl` projects a splat
  to an ellipse, and clips it at the near plane (Zwicker et al. 2001). `gl/programs.py` loads shaders. `compositing.py`
  adds up many layers of splats in float64. Where a context is lost, `recovery.py` makes another.
- `cpu/brick_rasterizer.py` draws bricks on several threads, by kernels: `march.cpp` takes the samples of a ray in a
  brick, with jitter, until early ray termination (Max 1995). `brick_cache.py` keeps the texels of bricks. `cpu/grid.py`
  divides the picture into tiles, `cpu/bands.py` joins tiles whose bricks have room at once, and `subsampling.py`
  interpolates between pixels that are drawn. `cpu/field.py` and `cpu/light.py` describe what is sampled, and light and
  extinction that depend on the view or on gradients; `cpu/extremum.py` says which scalar a ray looks for, and
  `cpu/mixture.py` where bricks of several volumes lie.

Over pictures of both, `cpu/lines.py` draws the lines of overlays, which `overlay.py` makes.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
