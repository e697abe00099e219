"""Many volumes to as many films.

In: names and patterns of volumes. Out: a suggested scene and a film for each, a table, and turntable.json. A volume
that fails does not stop the others.

- `batch.py`: a process for each volume, one after the other; `one_film.py`: its scene and its film; `manifest.py`: the
  table and turntable.json.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
