from .open_labels import label_problems as label_problems
from .open_scene import resolve_scene as resolve_scene

# isort: split
# For tests alone: steps and constants that no other room uses.
from .level_errors import LevelErrors as LevelErrors, mean_around as mean_around
