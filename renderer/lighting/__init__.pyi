from .light_grid import compute_light_grid as compute_light_grid
