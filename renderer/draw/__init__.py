"""Draw sorted splats or bricks into a float image.

In: `SplatBatch` or `BrickBatch`, the order of its elements, and a `View`. Out: float32 [height, width, 4],
premultiplied RGBA without a background. Each footprint, splats or bricks, has its own rasteriser.
Bricks have none for a GPU, which would filter texels with weights of about 8 bits, and limit pictures to some 50 dB. So
a scene of bricks gives the same bytes on machines with and without a GPU.

- `rasterizer.py`: the interface of all rasterisers.
- `opening.py`: opens the rasteriser of a scene.
- `overlay.py`: makes the lines of overlays. `lines.py`: draws them over pictures of splats and of bricks.

`splats/` draws splats with OpenGL, which no other folder needs:

- `splats/splat_rasterizer.py`: the rasteriser. `splats/shaders/project.glsl` projects a splat to an ellipse, and clips
  it at the near plane (Zwicker et al. 2001).
- `splats/programs.py`: loads shaders.
- `splats/samples.py`: divides pictures into tiles, and averages the samples of a pixel.
- `splats/compositing.py`: divides splats into chunks that are added up in float64.
- `splats/recovery.py`: makes another OpenGL context when a context is lost.
- `splats/opengl_probe.py`: finds the OpenGL of this machine, for a report.

`bricks/` draws bricks on several threads, by kernels (`march.cpp`, `mixture.cpp`, `extremum.cpp`):

- `bricks/brick_rasterizer.py`: the rasteriser, which shares the memory for bricks among layers.
- `bricks/brick_cache.py`: keeps the texels of the bricks of layers.
- `bricks/atlas.py`: keeps the texels of bricks of one kind in slots, and decides which bricks stay.
- `bricks/grid.py`: divides the picture into tiles, and finds the bricks over each.
- `bricks/bands.py`: joins tiles whose bricks fit into the caches at once.
- `bricks/antialiasing.py`: draws several rays in pixels whose colour a single ray does not give.
- `bricks/subsampling.py`: interpolates between pixels that are drawn.
- `bricks/field.py`: the field of scalars that samples are taken from, and its colours.
- `bricks/light.py`: light and extinction that depend on the view or on gradients.
- `bricks/extremum.py`: the rules by which a ray looks for the most extreme scalar.
- `bricks/mixture.py`: the positions of the bricks of several volumes along a ray.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
