"""Compute the truth with which pictures are compared: means over pixels of the converged ray integral.

In: layers, each a `Volume` and its transfer function, and a `View`. Out: the float64 colours of rays through places in
the picture, by the continuous fields (Max 1995), and means of the colours over pixels. Labels are not interpolated, but
divide space into regions; a mask shows a layer in some regions alone. `RayIntegrator.converge` halves the steps until
nothing changes (Etiene et al. 2014). Light that scatters is computed by Monte Carlo, with its standard error.

- `pixel_means.py`: the mean over each pixel, by as many rays as it needs, and its variance; `places.py`: the places in
  the picture that the rays pass through.
- `scene_rays.py`: the rays of a scene, in the colours of its mode, and the search for the largest scalar of a ray.
- `path_tracer.py`: the light of rays through matter that scatters it; `pixel_light.py`: its mean over pixels;
  `scene_paths.py`: the same of a scene, as its pictures show it.
- `integrator.py`: places to rays in each layer's grid, and steps halved until they converge; `optics.py`: layers, their
  transfer functions and their light, as kernels take them; `kept_parts.py`: the parts of rays that clipping leaves.
- In the kernels: `truth_integral.cpp`, one ray through all layers; `truth_layer.h`, its pieces in one layer;
  `truth_extremum.cpp`, its largest scalar; `truth_cells.h`, the cells along a ray; `truth_cells.cpp`, the voxels at
  their corners; `truth_cubic.h`, the field along a ray through a cell is a cubic polynomial; `truth_labels.h`, the
  label at a point; `truth_mask.cpp`, the parts of rays inside a mask; `truth_light.h`, the light on a point of a ray;
  `truth_paths.cpp`, paths of scattered light; `truth_medium.h` and `truth_medium.cpp`, a layer at any point, and along
  any ray; `truth_random.h`, random numbers.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
