from .integrator import (
    Convergence as Convergence,
    Progress as Progress,
    RayIntegrator as RayIntegrator,
    ignore as ignore,
    integrate as integrate,
)
from .optics import TrueLayer as TrueLayer
from .scene_rays import SceneRays as SceneRays, chord_lengths as chord_lengths

# isort: split
# For tests alone: steps and constants that no other room uses.
from .integrator import index_rays as index_rays, rays_through_pixels as rays_through_pixels
from .kept_parts import keep_parts as keep_parts
from .optics import optics_of as optics_of
