"""Turns files and options into a `Job`.

In: a scene file, a sidecar, or a volume and options. Out: `Job`, which is a scene with its frames and its output; or a
suggested scene as text. Also declares the click options that several commands share.

- `job.py`: a scene or sidecar and the frames to draw; `sidecar_file.py` reads sidecars.
- `volume_arguments.py`, `film_arguments.py`: options of commands without a scene; `volume_names.py`: patterns of
  volumes, and the names of their films.
- `suggested_scene.py`: a scene that shows a volume; `scene_text.py`: its YAML, with comments.
- `truncation_guard.py`: volumes whose file becomes shorter while it is read.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
