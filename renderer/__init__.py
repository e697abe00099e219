"""hsplat as a library: scalar volumes to pictures and films.

In: a scene file, a Scene, or one or several volumes: arrays [z, y, x], images of other libraries, files. Out: a frame,
a film, or the exact picture, drawn in this process to the same bytes as by the command `hsplat render`. `docs/api.md`
has examples.

- `api.py`: the functions of this door; `api_scenes.py` and `api_layers.py`: what they take; `api_results.py`: what they
  return. `errors.py`: every error that a user sees.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
