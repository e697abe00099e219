"""Turns files and options into a `FilmJob`.

In: a scene file, a sidecar, or a volume and options. Out: `FilmJob`, which is a scene with its frames and its output;
or a scene as text, suggested or with the look of another. Also declares the click options that several commands share.

- `job.py`: a scene or sidecar and the frames to draw.
- `volume_arguments.py`: options of commands without a scene; `volume_names.py`: patterns of volumes, and the names of
  their films.
- `scene_text.py`: a scene that shows a volume, as YAML with comments; `shared_look.py`: one with the look of another.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
