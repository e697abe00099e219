"""How much light reaches each place of the object, whatever the view: ambient occlusion, and the shadows of a light.

In: `Volume`, `TransferFunction`, the direction of a light that is fixed to the object. Out: `LightGrid`, factors on
the ambient and on the diffuse light, on a grid of cells.

- `light_grid.py`: its definition, and how it is computed from the cells' mean extinctions. The kernels of
  `light_rays.cpp` average extinctions, and send rays through them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
