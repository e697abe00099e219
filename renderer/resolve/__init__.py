"""Resolve an open scene: choose all that it leaves to its volumes, once they can be read.

In: a scene, and a function that reads its volumes. Out: the same scene, in which nothing is left open; or problems with
labels that are not there.

- `open_scene.py` resolves a scene: it makes a layer for each channel, and motions for `time: auto`.
- `open_labels.py`: which labels are shown, with their numbers, names, colours and opacities.
- `percentile_values.py`: values for percentiles.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
