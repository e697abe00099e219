from .integrator import (
    Convergence as Convergence,
    Progress as Progress,
    RayIntegrator as RayIntegrator,
    ignore as ignore,
    index_rays as index_rays,
)
from .optics import TrueLayer as TrueLayer
from .path_tracer import PathTracer as PathTracer
from .pixel_light import PixelLight as PixelLight, light_of_pixels as light_of_pixels
from .pixel_means import (
    RAYS_PER_SQUARE as RAYS_PER_SQUARE,
    PixelMeans as PixelMeans,
    mean_over_pixels as mean_over_pixels,
    means_over as means_over,
    sides_for as sides_for,
)
from .places import pixel_centres as pixel_centres, places_in_pixels as places_in_pixels, states_of as states_of
from .scene_paths import ScenePaths as ScenePaths
from .scene_rays import SceneRays as SceneRays, chord_lengths as chord_lengths

# isort: split
# For tests alone: steps and constants that no other room uses.
from .integrator import rays_through as rays_through
from .kept_parts import keep_parts as keep_parts
from .optics import optics_of as optics_of
from .pixel_means import MeanPicture as MeanPicture
