"""Compute the light that reaches each position in the object, for all views: ambient occlusion, and soft shadows.

In: `Volume`, `TransferFunction`, the direction of a light that is fixed to the object. Out: `LightGrid`, a grid of
cells with factors on the ambient and on the diffuse light.

- `environment.py`: the sources of light around the object: an environment and a key light
- `light_grid.py`: the light grid, computed from the cells' mean extinctions
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
