"""Makes a film of each of many volumes.

In: names and patterns of volumes. Out: a scene for each volume, suggested or with the look of another scene, its film,
a table, turntable.json, and a page of all films. A volume that fails does not stop the others.

- `batch.py`: makes films of several volumes; `film_process.py`: the processes that make them.
- `film_request.py`: a film that is requested; `one_film.py`: makes its scene and the film; `manifest.py`: the table and
  turntable.json.
- `gallery.py`: index.html, a page of all films; `posters.py`: their small pictures.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
