"""Resolve an open scene: choose everything that it leaves to its volumes, once they can be read.

In: a scene, and a function that reads its volumes. Out: the same scene with nothing left open, or the problems found,
such as labels that no voxel has.

- `open_scene.py` resolves a scene: it makes a layer for each channel, and motions for `time: auto`.
- `store_levels.py`: chooses the level of a store that is drawn; `level_errors.py`: measures the errors of levels by a
  few exact rays; `crossed_blocks.py`: the blocks of the finest level that these rays need.
- `open_labels.py`: chooses the labels that are shown, with their numbers, names, colours and opacities.
- `percentile_values.py`: replaces percentiles by values.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
