"""Compute the light that reaches each place of the object, for all views: ambient occlusion, and soft shadows.

In: `Volume`, `TransferFunction`, the direction of a light that is fixed to the object. Out: `LightGrid`, factors on
the ambient and on the diffuse light, on a grid of cells.

- `light_grid.py`: the light grid, computed from the cells' mean extinctions
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
