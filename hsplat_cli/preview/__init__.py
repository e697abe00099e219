"""A page that shows a scene before its film is made.

In: a film job. Out: one HTML page: frames of the film, the object as it turns, histograms with what is seen of them,
slices, and variants with the lines that make them.

- `watch.py` draws a scene whenever its file changes; `live_page.py` shows that on a page that is open,
  from a file or from `server.py`.
- `page.py` puts it together; `studio.py` draws small pictures from layers that are made once; `variants.py`: other
  opacities, tolerances and looks; `volume_chart.py`: histograms and slices.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
