from .environment import (
    LightSources as LightSources,
    environment_radiance as environment_radiance,
    key_radiance as key_radiance,
    key_solid_angle as key_solid_angle,
)
from .light_grid import compute_light_grid as compute_light_grid
from .matter_grid import Matter as Matter
from .radiance_grid import (
    RadianceGrid as RadianceGrid,
    compute_radiance_grid as compute_radiance_grid,
    solve_bytes as solve_bytes,
)
from .scene_light import (
    SceneLight as SceneLight,
    SurfaceLight as SurfaceLight,
    solve_scene_light as solve_scene_light,
    sources_of as sources_of,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .exposure import BRIGHT_SHARE as BRIGHT_SHARE, choose_stops as choose_stops
from .matter_grid import place_grid as place_grid
