"""Compute the light that reaches each position in the object, for all views: ambient occlusion, and soft shadows.

In: `Volume`, `TransferFunction`, the direction of a light that is fixed to the object. Out: `LightGrid`, a grid of
cells with factors on the ambient and on the diffuse light. In: `Matter` of all layers, the scene's `LightSpec`. Out:
`SceneLight`, a grid of the mean radiance in matter that scatters light.

- `environment.py`: the sources of light around the object: an environment and a key light
- `matter_grid.py`: the mean extinctions and albedos of all layers, on one grid in the world
- `radiance_grid.py`: the light in matter that scatters, on that grid
- `scene_light.py`: the light of a scene, with its exposure
- `exposure.py`: the exposure of a scene's light, by the brightness of the visible matter
- `light_grid.py`: the light grid, computed from the cells' mean extinctions
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
