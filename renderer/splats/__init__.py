"""Turn the cells of a cut into splats.

In: `Cut`, and the scene's footprint. Out: `SplatBatch` of centres, sizes, colours and optical depths, with the
footprint that spreads each splat over pixels: Gaussian without ripple, or Gouraud-shaded triangles (Laur and Hanrahan
1991).

- `splats.py`: splats, made from cells, and the formulas of both footprints
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
