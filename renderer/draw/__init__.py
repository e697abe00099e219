"""Sorted splats or bricks to a float image.

In: `SplatBatch` or `BrickBatch`, the order of its elements, and a `View`. Out: float32 [height, width, 4],
premultiplied RGBA without a background. There are two backends, OpenGL and kernels on the CPU:

- `gl/raster.py` makes the OpenGL context, and draws splats. `gl/shaders/project.glsl`
  projects a splat to an ellipse, and clips it at the near plane (Zwicker et al. 2001). `gl/programs.py` loads shaders.
- `gl/bricks.py` draws bricks with OpenGL. `gl/atlas.py` uploads texels to the GPU. `gl/shaders/brick_fragment.glsl`
  takes the samples of a ray in a brick, with jitter, until early ray termination (Max 1995).
- `cpu/raster.py` draws bricks on several threads, by kernels: `march.cpp` has the same loop over rays and samples.
  `cpu/grid.py` divides the picture into tiles; `cpu/field.py` and `cpu/light.py` describe what is sampled, and light
  and extinction that depend on the view or on gradients; `cpu/extremum.py` says which scalar a ray looks for.
  OpenGL has neither clipping, nor such light, nor extremes.

Both share `brick_cache.py` (bricks in a view; which of them are uploaded or evicted),
`subsampling.py` (pixels between those that are drawn are interpolated) and `constants.py`. `compositing.py` adds up
many layers of splats in float64. `rasterizer.py` says what backends have in common, and `recovery.py` opens one and
replaces it when its context is lost.

Over pictures of all backends, `cpu/lines.py` draws the lines of overlays, which `overlay.py` makes.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
