"""Turns files and options into a `FilmJob`.

In: a scene file, a sidecar, or a volume and options. Out: a `FilmJob`: a scene with its frames and its output; or the
text of a scene, either suggested for a volume or with the look of another scene. The room also declares the click
options of commands that take a volume.

- `job.py`: a scene or sidecar and the frames to draw.
- `volume_arguments.py`: options of commands without a scene; `volume_names.py`: patterns of volumes, and the names of
  their films.
- `scene_text.py`: a suggested scene for a volume, as YAML with comments; `shared_look.py`: scenes with the look of
  another scene.
- `editor_schema.py`: the JSON Schema beside scenes, and the line that names it to editors.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
