"""Sorted splats or bricks to a float image.

In: `SplatBatch` or `BrickBatch`, the order of its elements, and a `View`. Out: float32 [height, width, 4],
premultiplied RGBA without a background. Each footprint has its rasteriser.

- `rasterizer.py`: the interface of all rasterisers.
- `opening.py`: opens the rasteriser of a scene.
- `overlay.py`: makes the lines of overlays, and `lines.py` draws them, over pictures of splats and of bricks.

`splats/` draws splats with OpenGL, and nothing else needs it:

- `splats/splat_rasterizer.py`: the rasteriser. `splats/shaders/project.glsl` projects a splat to an ellipse, and clips
  it at the near plane (Zwicker et al. 2001).
- `splats/programs.py`: loads shaders.
- `splats/compositing.py`: divides splats into chunks that are added up in float64.
- `splats/recovery.py`: makes another context where one is lost.

`bricks/` draws bricks on several threads, by kernels (`march.cpp`, `mixture.cpp`, `extremum.cpp`):

- `bricks/brick_rasterizer.py`: the rasteriser; it shares the memory for bricks among layers.
- `bricks/brick_cache.py`: keeps the texels of bricks.
- `bricks/grid.py`: divides the picture into tiles, and finds the bricks over each.
- `bricks/bands.py`: joins tiles whose bricks have room at once.
- `bricks/antialiasing.py`: draws several rays in pixels that one ray cannot tell.
- `bricks/subsampling.py`: interpolates between pixels that are drawn.
- `bricks/field.py`: the scalars that samples are taken from, and the colours for them.
- `bricks/light.py`: light and extinction that depend on the view or on gradients.
- `bricks/extremum.py`: the scalar that a ray looks for.
- `bricks/mixture.py`: where bricks of several volumes lie along a ray.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
