"""Shows a scene on a page before its film is made.

In: a film job. Out: one HTML page: frames of the film, the object as it turns, histograms with the visible values
marked, slices, and variants of the scene with the lines of YAML that make them.

- `watch.py` draws a scene whenever its file changes; `live_page.py` shows the pictures on an open page, by a file or by
  `server.py`.
- `page.py` makes the page; `studio.py` draws small pictures from layers that are made once; `variants.py`: other
  opacities, tolerances and looks; `volume_chart.py`: histograms and slices.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
