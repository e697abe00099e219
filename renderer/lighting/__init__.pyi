from .environment import (
    LightSources as LightSources,
    environment_radiance as environment_radiance,
    key_radiance as key_radiance,
    key_solid_angle as key_solid_angle,
)
from .light_grid import compute_light_grid as compute_light_grid
