from .integrator import (
    Convergence as Convergence,
    Progress as Progress,
    RayIntegrator as RayIntegrator,
    ignore as ignore,
    integrate as integrate,
)
from .optics import TrueLayer as TrueLayer
from .scene_rays import SceneRays as SceneRays, chord_lengths as chord_lengths
