"""The converged ray integral that pictures are measured against.

In: `Volume`, transfer function and `View`. Out: float64 images of the continuous field: trilinear interpolation, then
classification (Max 1995). `converged_image` halves the steps of `integrate` until nothing changes; verified by its
order of convergence (Etiene et al. 2014).

- `scene_rays.py`: the rays of a scene, in the colours of its mode; `extremum.py`: the largest scalar of a ray.
- `integrator.py`: the image, and the steps halved until it converges; `kernel.py`: one ray, compiled; `cells.py`:
  the cells along a ray, and the voxels at their corners; `cutting.py`: the parts of rays that cuts leave; `cubic.py`:
  the field along a ray through a cell is a cubic polynomial; `light.py`: the light on a point of a ray.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
