"""Many volumes to as many films.

In: names and patterns of volumes. Out: a scene, suggested or with the look of another, and a film for each, a table,
turntable.json, and a page of all films. A volume that fails does not stop the others.

- `batch.py`: a process for each volume, one after the other; `up_to_date.py`: which need none; `one_film.py`: a scene
  and its film; `manifest.py`: the table and turntable.json.
- `gallery.py`: index.html, a page of all films; `posters.py`: their small pictures.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
