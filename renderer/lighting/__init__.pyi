from .light_grid import compute_light_grid as compute_light_grid

# isort: split
# For tests alone: steps and constants that no other room uses.
from .light_grid import LIGHT_RADIUS as LIGHT_RADIUS, OCCLUSION_RADIUS as OCCLUSION_RADIUS, START_CELLS as START_CELLS
