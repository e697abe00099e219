from .open_labels import label_problems as label_problems
from .open_scene import resolve_scene as resolve_scene
